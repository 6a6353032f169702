#!/usr/bin/env bash
# Run the tests: first those without a browser, on two workers, then the journeys in a browser one by
# one (two journeys at a time run into their time limits where a machine is slow). pyright uses what
# they leave idle: the second core during collection and journeys. All parts always run, and
# those that failed are named last. What takes long (full products of parameters, a hundred kills,
# every detail of a page) is `make nightly`. Arguments go to both runs of pytest.
set -u
python=.venv/bin/python
# The workers are the parallelism; threads below them would only compete.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1

types=$(mktemp)
trap 'rm -f "$types"' EXIT
failed=()
nice -n 19 .venv/bin/pyright >"$types" 2>&1 &
pyright=$!
$python -m pytest -n 2 --dist worksteal -m "not browser and not nightly" --durations=25 "$@" ||
    failed+=("tests without a browser")
# only files that name a browser, or a fixture of a conftest.py that opens one, are imported
mapfile -t journeys < <(grep -rlwE 'browser|page|tab|open_tab' tests --include='test_*.py')
$python -m pytest -m "browser and not nightly" "${journeys[@]}" --durations=25 "$@" ||
    failed+=("journeys in a browser")
wait "$pyright" || failed+=("pyright")
cat "$types"

[ ${#failed[@]} -eq 0 ] && exit 0
printf 'failed: %s\n' "${failed[@]}" >&2
exit 1
