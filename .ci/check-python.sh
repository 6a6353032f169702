#!/usr/bin/env bash
# Say plainly what is missing when "$1" cannot make the virtual environment.
set -u
python=$1

if ! command -v "$python" >/dev/null; then
    echo "warpspace needs Python 3.11 to 3.14, and '$python' was not found." >&2
    echo "Name another one:  make PYTHON=python3.12 …" >&2
    exit 1
fi
if ! "$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))'; then
    echo "warpspace needs Python 3.11 to 3.14; '$python' is $("$python" -V 2>&1)." >&2
    echo "Name another one:  make PYTHON=python3.12 …" >&2
    exit 1
fi
if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    echo "'$python' has no venv module; on Debian or Ubuntu:  apt-get install python3-venv" >&2
    exit 1
fi
