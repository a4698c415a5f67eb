#!/usr/bin/env bash
# Write the exact versions that the tests run with, for every Python and platform that pyproject.toml allows:
#   constraints.txt         the newest releases
#   constraints-lowest.txt  of each direct dependency the lowest release that pyproject.toml allows
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"${PYTHON:-python3}" -m venv "$scratch"
"$scratch/bin/python" -m pip install --quiet --disable-pip-version-check uv

compile() {
    "$scratch/bin/uv" pip compile --quiet --universal --python-version 3.11 --extra test --extra bench --upgrade \
        --no-emit-index-url --custom-compile-command 'make lock' "$@" pyproject.toml >/dev/null
}
compile --output-file constraints.txt
compile --resolution lowest-direct --output-file constraints-lowest.txt
