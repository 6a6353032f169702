#!/usr/bin/env bash
# Run every test: in parallel what can be, then the browser tests one after the other.
# Both parts always run; coverage is that of both.
set -u
python=.venv/bin/python
# The workers are the parallelism; threads below them would only compete.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1

status=0
rm -f .coverage .coverage.*
$python -m pytest -n 2 --dist loadfile -m "not browser" --durations=10 \
    --cov --cov-report= || status=$?
$python -m pytest -m browser --cov --cov-append --cov-report=term || status=$?
exit "$status"
