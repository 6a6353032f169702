#!/usr/bin/env bash
# Install the Debian packages that the tests draw and browse with, or say which are missing.
# Arguments: further packages. Missing ones end a CI run; elsewhere the tests that need them are skipped.
set -u
packages=(libegl1 libgl1-mesa-dri chromium fonts-dejavu-core "$@")

installed() {
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

find_missing() {
    missing=()
    for package in "${packages[@]}"; do
        installed "$package" || missing+=("$package")
    done
}

give_up() {
    echo "$1" >&2
    [ -z "${CI:-}" ] || exit 1
    echo "Going on without; the tests that need them are skipped." >&2
    exit 0
}

if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    if command -v chromium >/dev/null || command -v chromium-browser >/dev/null ||
        command -v google-chrome >/dev/null; then
        exit 0 # not a Debian; whether OpenGL works is found out by the tests themselves
    fi
    give_up "The tests need Chromium and EGL with a Mesa driver (Debian: ${packages[*]})."
fi

find_missing
[ ${#missing[@]} -eq 0 ] && exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
    if command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
        as_root=(sudo -n)
    else
        give_up "Missing system packages:  sudo apt-get install ${missing[*]}"
    fi
fi

install_missing() {
    ${as_root[@]+"${as_root[@]}"} env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -q --no-install-recommends "${missing[@]}" </dev/null
}

echo "Installing system packages: ${missing[*]}"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
if ! install_missing >"$log" 2>&1; then
    # Usually the package lists are missing or out of date.
    ${as_root[@]+"${as_root[@]}"} apt-get update -q >"$log" 2>&1
    if ! install_missing >>"$log" 2>&1; then
        tail -n 20 "$log" >&2
        give_up "Could not install; try:  apt-get update && apt-get install ${missing[*]}"
    fi
fi
