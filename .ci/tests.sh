#!/usr/bin/env bash
# Run every test: first those without a browser, on two workers, then the browser tests one by one,
# since drawing in software takes both cores. Both parts always run.
# Arguments go to both runs of pytest.
set -u
python=.venv/bin/python
# The workers are the parallelism; threads below them would only compete.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1

status=0
$python -m pytest -n 2 --dist loadfile -m "not browser" --durations=10 "$@" || status=$?
$python -m pytest -m browser --durations=10 "$@" || status=$?
exit "$status"
