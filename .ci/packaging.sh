#!/usr/bin/env bash
# Try what is handed out: builds wheel and sdist twice, then puts the wheel into empty environments,
# for every Python that pyproject.toml names in its classifiers, with the newest packages and with the
# lowest that it allows (where these have a wheel for that Python), and runs .ci/smoke.py in each. The
# newest are installed with pip, as users do, with megabytes and seconds; then the sdist in place of
# the wheel. A Python that this machine does not have is named as not tried.
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

# fill_lowest ENVIRONMENT PYTHON: the lowest packages that the wheel allows, resolved and installed
fill_lowest() {
    "$uv" pip compile --quiet --python "$2" --resolution lowest-direct --only-binary :all: \
        --extra urdf pyproject.toml -o "$1.txt" &&
        "$uv" venv --quiet --python "$2" "$1" &&
        "$uv" pip install --quiet --python "$1/bin/python" -r "$1.txt" &&
        "$uv" pip install --quiet --python "$1/bin/python" --no-deps "$wheel"
}

# fill_newest ENVIRONMENT PYTHON: pip install, in two steps, so that the network is not in the seconds
fill_newest() {
    local pip=("$1/bin/python" -m pip --quiet --disable-pip-version-check --no-cache-dir) before began
    "$uv" venv --quiet --seed --python "$2" "$1" && before=$(megabytes "$1") &&
        "${pip[@]}" download -d "$1-files" "$wheel" && began=$(date +%s%N) &&
        "${pip[@]}" install --no-index --find-links "$1-files" "$wheel" || return 1
    installed="$(megabytes "$1-files") MB of downloads, installed in $((($(date +%s%N) - began) / 1000000000)) s"
    installed+=" to $(($(megabytes "$1") - before)) MB"
    "${pip[@]}" install "$wheel[urdf]"
}

megabytes() { # megabytes FOLDER
    du -s --block-size=1000000 --apparent-size "$1" | cut -f1
}

smoke() { # smoke ENVIRONMENT
    rm -rf "$work/run" && mkdir "$work/run" &&
        (cd "$work/run" && "$1/bin/python" "$root/.ci/smoke.py" "$version")
}

bash .ci/dist.sh "$python" "$work/dist" || { echo "FAILED  wheel and sdist" >&2; exit 1; }
wheel=$(echo "$work"/dist/*.whl)
sdist=$(echo "$work"/dist/*.tar.gz)
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
    for resolution in newest lowest; do
        environment=$work/$name-$resolution
        installed=""
        "fill_$resolution" "$environment" "$interpreter" >"$log" 2>&1 && smoke "$environment" >>"$log" 2>&1
        note $? "Python $name, $resolution packages: $(tail -n 1 "$log" | cut -d: -f2-)"
        if [ "$resolution" = newest ]; then
            summary+=("        $installed; $(tail -n 2 "$log" | head -n 1)")
            "$environment/bin/python" -m pip install --quiet --force-reinstall --no-deps "$sdist" >"$log" 2>&1 &&
                smoke "$environment" >>"$log" 2>&1
            note $? "Python $name, sdist: $(tail -n 2 "$log" | head -n 1)"
        fi
        if [ "$resolution" = newest ] && [ ! -e "$work/typed" ]; then
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
        rm -rf "$environment"* "$work/run"
    done
done

for minor in $promised; do
    [[ $tried = *" $minor "* ]] || summary+=("not tried  Python 3.$minor")
done

echo
printf '%s\n' "${summary[@]}"
exit "$failed"
