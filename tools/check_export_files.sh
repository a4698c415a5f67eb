#!/usr/bin/env bash
# Read exports of files with the formats' own libraries and compare all numbers; TRC and MOT with OpenSim as well,
# and retarget key points to a robot hand with dex-retargeting, these two in environments of their own.
#
#   tools/check_export_files.sh [DB]     a database with grasps in motion; one of `graspdb demo` unless given
#
# The environments are .venv-opensim and .venv-retarget; `make clean` removes them.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}

db=${1:-}
if [ -z "$db" ]; then
    .venv/bin/graspdb demo "$scratch/demo" >/dev/null
    db=$scratch/demo/grasps
fi

.venv/bin/python tests/exports/check_files.py "$db" "$scratch/files"

environment() { # FOLDER PACKAGES...: make it with the packages, unless it is there
    local venv=$1
    shift
    [ -f "$venv/done" ] && return
    "${PYTHON:-python3}" -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$@"
    touch "$venv/done"
}

environment .venv-opensim opensim==4.6 numpy
for format in trc mot; do
    .venv/bin/graspdb export "$format" "$scratch/$format" --db "$db"
done
.venv-opensim/bin/python tests/exports/check_opensim.py "$scratch/trc" "$scratch/mot"

environment .venv-retarget torch==2.13.0 example-robot-data==6.0.0 --editable '.[retarget]'
.venv-retarget/bin/python tests/exports/check_retarget.py "$db" "$scratch/robot"
