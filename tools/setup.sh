#!/usr/bin/env bash
# Make a virtual environment with graspdb, its tests and benchmarks, and everything that they need.
# Does nothing where that is already there, so every target of the Makefile may call it.
#
#   tools/setup.sh [FOLDER [CONSTRAINTS]]     .venv and constraints.txt unless given
#
# PYTHON in the environment names the interpreter; else it is the first of those below that is new enough.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

venv=${1:-.venv}
constraints=${2:-constraints.txt}
candidates=("${PYTHON:-python3}")
[ -n "${PYTHON:-}" ] || candidates+=(python3.13 python3.12 python3.11 python3.14)
stamp=$venv/graspdb-setup

# What Open3D's wheel needs from the system, and the Debian and Ubuntu package that has it.
declare -A package_of=(
    [libEGL.so.1]=libegl1
    [libGL.so.1]=libgl1
    [libX11.so.6]=libx11-6
    [libidn2.so.0]=libidn2-0
    [libudev.so.1]=libudev1
    [libusb-1.0.so.0]=libusb-1.0-0
)

stop() {
    printf 'setup: %s\n' "$@" >&2
    exit 1
}

find_python() {
    local candidate
    for candidate in "${candidates[@]}"; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
    stop "graspdb needs Python 3.11 or newer; found: $("${candidates[0]}" --version 2>&1 || true)" \
        "Debian 12 and Ubuntu 24.04 bring one (apt-get install python3); or name one: PYTHON=/path/to/python3.12 make ..."
}

missing_packages() { # the packages that hold the libraries which cannot be loaded, and ensurepip
    "$1" - "${!package_of[@]}" <<'PYTHON' | while read -r name; do echo "${package_of[$name]:-$name}"; done
import ctypes
import importlib.util
import sys

for library in sys.argv[1:] if sys.platform == "linux" else []:
    try:
        ctypes.CDLL(library)
    except OSError:
        print(library)
if importlib.util.find_spec("ensurepip") is None or importlib.util.find_spec("venv") is None:
    print("python{}.{}-venv".format(*sys.version_info))
PYTHON
}

install_packages() {
    local remedy="Install them and run again: apt-get install $*"
    local as_root=()
    command -v apt-get >/dev/null || stop "these Debian packages, or this system's like, are missing: $*"
    if [ "$(id -u)" -ne 0 ]; then
        sudo -n true 2>/dev/null || stop "system packages are missing, and installing them needs root." "$remedy"
        as_root=(sudo -n)
    fi
    echo "setup: installing system packages: $*"
    local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=120)
    "${apt[@]}" update </dev/null || echo "setup: the list of packages could not be brought up to date" >&2
    "${apt[@]}" install -y --no-install-recommends "$@" </dev/null || stop "apt-get failed." "$remedy"
}

# The tests of pages drive a browser; nothing else needs one, so setting up goes on without.
browser_for_tests() {
    local name
    for name in chromium chromium-browser google-chrome; do
        if command -v "$name" >/dev/null; then return; fi
    done
    (install_packages chromium) ||
        echo "setup: no Chromium was found or installed; the tests in tests/browser will fail until there is one." >&2
}

# A change of any of these makes the environment anew.
fingerprint() {
    echo "$PWD"
    sha256sum pyproject.toml "$constraints" tools/setup.sh
}

if [ -f "$stamp" ] && [ "$(fingerprint)" = "$(cat "$stamp")" ] && "$venv/bin/python" -c '' 2>/dev/null; then
    exit 0
fi

python=$(find_python)
packages=$(missing_packages "$python")
# shellcheck disable=SC2086  # one word a package
[ -z "$packages" ] || install_packages $packages
browser_for_tests

echo "setup: making $venv with $("$python" --version) and the versions in $constraints"
"$python" -m venv --clear "$venv"
install=("$venv/bin/python" -m pip install --quiet --no-input --disable-pip-version-check --constraint "$constraints")
# The build backend comes first, so that it too has the version in the constraints.
"${install[@]}" hatchling
"${install[@]}" --no-build-isolation --editable '.[test,bench]'
"$venv/bin/python" -c 'import open3d' ||
    stop "Open3D cannot be loaded; the lines above name the reason. Install the package that has the library and run again."
fingerprint >"$stamp"
