#!/usr/bin/env bash
# Try what is handed out: builds wheel and sdist twice, then puts the wheel into empty environments,
# for every Python that pyproject.toml names in its classifiers, with the newest packages and with the
# lowest that it allows (where these have a wheel for that Python), and runs .ci/smoke.py in each. A
# Python that this machine does not have is named as not tried.
# A small typed program is checked against the installed wheel, the citation file against its schema.
# Takes some minutes a Python. PYTHONS="python3.12 /opt/python3.14/bin/python" names others.
set -u
cd "$(dirname "$0")/.."
root=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
unset PYTHONPATH PYTHONHOME VIRTUAL_ENV
export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1} UV_PYTHON_DOWNLOADS=never UV_NO_PROGRESS=1
export UV_LINK_MODE=${UV_LINK_MODE:-copy}
python=${PYTHON:-$root/.venv/bin/python}
log=$work/log
failed=0
promised=$(sed -n 's/.*"Programming Language :: Python :: 3\.\([0-9]*\)".*/\1/p' pyproject.toml)
tried=" "
summary=()

note() { # note STATUS TEXT
    local word="works "
    [ "$1" -eq 0 ] || { word="FAILED"; failed=1; tail -n 15 "$log" >&2; }
    summary+=("$word  $2")
    echo "$word  $2"
}

# The Pythons there are: the first that runs of each version that is promised.
find_pythons() {
    local minor candidate
    for minor in $promised; do
        for candidate in "$(command -v "python3.$minor" 2>/dev/null)" "/usr/bin/python3.$minor" \
            "$HOME"/.pyenv/versions/3."$minor".*/bin/python /opt/python/cp3"$minor"*/bin/python; do
            [ -x "$candidate" ] || continue
            "$candidate" -c "import sys, venv; sys.exit(sys.version_info[:2] != (3, $minor))" \
                2>/dev/null || continue
            echo "$candidate"
            break
        done
    done
}

# fill ENVIRONMENT PYTHON RESOLUTION: the packages of the wheel, resolved and installed
fill() {
    local requirements=$1.txt wheels=()
    [ "$3" = highest ] || wheels=(--only-binary :all:)
    "$uv" pip compile --quiet --python "$2" --resolution "$3" ${wheels[@]+"${wheels[@]}"} \
        --extra urdf pyproject.toml -o "$requirements" &&
        "$uv" venv --quiet --python "$2" "$1" &&
        "$uv" pip install --quiet --python "$1/bin/python" -r "$requirements" &&
        "$uv" pip install --quiet --python "$1/bin/python" --no-deps "$wheel"
}

bash .ci/dist.sh "$python" "$work/dist" || { echo "FAILED  wheel and sdist" >&2; exit 1; }
wheel=$(echo "$work"/dist/*.whl)
version=$(basename "$wheel" | cut -d- -f2)
summary+=("works   wheel and sdist of $version, two builds alike")

"$python" -m venv "$work/tools" && "$work/tools/bin/pip" install -q uv >"$log" 2>&1 ||
    { cat "$log" >&2; echo "uv cannot be had from the package index" >&2; exit 1; }
uv=$work/tools/bin/uv

"$uv" tool run --quiet --from cffconvert cffconvert --validate -i CITATION.cff >"$log" 2>&1
note $? "CITATION.cff"
"$uv" tool run --quiet twine check --strict "$work"/dist/* >"$log" 2>&1
note $? "metadata and readme of wheel and sdist"

read -r -a pythons <<<"${PYTHONS:-$(find_pythons | tr '\n' ' ')}"
[ ${#pythons[@]} -gt 0 ] || { echo "no Python that is promised was found" >&2; exit 1; }
for interpreter in "${pythons[@]}"; do
    name=$("$interpreter" -c 'import platform; print(platform.python_version())')
    tried+="$(echo "$name" | cut -d. -f2) "
    for resolution in highest lowest-direct; do
        environment=$work/$name-$resolution
        mkdir -p "$work/run"
        fill "$environment" "$interpreter" "$resolution" >"$log" 2>&1 &&
            (cd "$work/run" && "$environment/bin/python" "$root/.ci/smoke.py" "$version") >>"$log" 2>&1
        note $? "Python $name, $resolution packages: $(tail -n 1 "$log" | cut -d: -f2-)"
        if [ "$resolution" = highest ] && [ ! -e "$work/typed" ]; then
            touch "$work/typed"
            cp tests/typed/program.py "$work/run/program.py"
            (cd "$work/run" && printf '{"typeCheckingMode": "strict", "include": ["program.py"]}' \
                >pyrightconfig.json && "$(dirname "$python")/pyright" \
                --pythonpath "$environment/bin/python" -p .) >"$log" 2>&1
            note $? "typed program against the wheel, pyright strict"
            (cd "$work/run" && "$uv" tool run --quiet --python "$interpreter" mypy --strict \
                --python-executable "$environment/bin/python" program.py) >"$log" 2>&1
            note $? "typed program against the wheel, mypy strict"
        fi
        rm -rf "$environment" "$work/run"
    done
done

for minor in $promised; do
    [[ $tried = *" $minor "* ]] || summary+=("not tried  Python 3.$minor")
done

echo
printf '%s\n' "${summary[@]}"
exit "$failed"
