#!/usr/bin/env bash
# Run the tests: first those without a browser, on two workers, then the journeys in a browser one by
# one, since drawing in software takes both cores. Both parts always run. What takes long (full
# products of parameters, a hundred kills, every detail of a page) is `make nightly`.
# Arguments go to both runs of pytest.
set -u
python=.venv/bin/python
# The workers are the parallelism; threads below them would only compete.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1

status=0
$python -m pytest -n 2 --dist worksteal -m "not browser and not nightly" --durations=25 "$@" || status=$?
$python -m pytest -m "browser and not nightly" --durations=25 "$@" || status=$?
exit "$status"
