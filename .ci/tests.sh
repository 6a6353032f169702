#!/usr/bin/env bash
# Run the tests: first those without a browser, on two workers, then the browser tests one by one,
# since drawing in software takes both cores. Both parts always run. Slow proofs (a hundred kills,
# ten thousand hostile messages, the largest page) are a target of their own, `make proofs`.
# Arguments go to both runs of pytest.
set -u
python=.venv/bin/python
# The workers are the parallelism; threads below them would only compete.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1

status=0
$python -m pytest -n 2 --dist loadfile -m "not browser and not proof" --durations=25 "$@" || status=$?
$python -m pytest -m "browser and not proof" --durations=25 "$@" || status=$?
exit "$status"
