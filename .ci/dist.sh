#!/usr/bin/env bash
# Build wheel and sdist into a folder, twice, and refuse them unless both times give the same bytes.
# Arguments: a Python with the packages of the extra `docs`, and the folder.
set -eu
python=$1
target=$2
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The time in the archives: that of the last commit, where there is one.
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || echo 1767225600)}
export SOURCE_DATE_EPOCH

for round in first second; do
    # The wheel comes from the sdist, so that the sdist is known to be complete.
    "$python" -m build --no-isolation --outdir "$work/$round" . >"$work/log" 2>&1 ||
        { cat "$work/log" >&2; exit 1; }
    (cd "$work/$round" && sha256sum ./*) >"$work/$round.sums"
    sleep 1 # another second, which must not show
done
if ! diff "$work/first.sums" "$work/second.sums"; then
    echo "two builds of the same sources differ" >&2
    exit 1
fi
mkdir -p "$target"
rm -f "$target"/warpspace-*
cp "$work"/first/* "$target/"
echo "the same bytes twice:"
cat "$work/first.sums"
