#!/usr/bin/env bash
# Run every test: the browser tests one after the other, and beside them, with what they leave of
# the processor, all others. Both parts always run; coverage is that of both.
set -u
python=.venv/bin/python
# The workers are the parallelism; threads below them would only compete.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1

status=0
rm -f .coverage .coverage.*
browser=$(mktemp)
trap 'rm -f "$browser"' EXIT
# What runs in the background is deaf to Ctrl-C, which the others test.
COVERAGE_FILE=.coverage.browser $python -m pytest -m browser --durations=10 \
    --cov --cov-report= >"$browser" 2>&1 &
COVERAGE_FILE=.coverage.others nice -n 10 $python -m pytest -n 2 --dist loadfile -m "not browser" \
    --durations=10 --cov --cov-report= || status=$?
wait $! || status=$?
cat "$browser"
$python -m coverage combine --quiet && $python -m coverage report || status=$?
exit "$status"
