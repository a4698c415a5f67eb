#!/usr/bin/env bash
# Read exports with the packages that they are for, in an environment of its own, since these are large.
#
#   tools/check_exports.sh [DB]     a database with grasps in motion; one of `graspdb demo` unless given
#
# The environment is .venv-exports; `make clean` removes it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

venv=.venv-exports
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export HF_HOME=$scratch/hf OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}

db=${1:-}
if [ -z "$db" ]; then
    .venv/bin/graspdb demo "$scratch/demo" >/dev/null
    db=$scratch/demo/grasps
fi

if [ ! -f "$venv/done" ]; then
    "${PYTHON:-python3}" -m venv "$venv"
    pip=("$venv/bin/python" -m pip install --quiet --disable-pip-version-check)
    "${pip[@]}" 'torch==2.14.1' 'torchvision==0.29.1'
    # Their own requirements would replace torch, or build a simulator; what reading needs comes behind.
    "${pip[@]}" --no-deps 'lerobot==0.4.4' 'robomimic==0.3.0'
    "${pip[@]}" 'datasets>=4,<5' 'diffusers<0.36' 'huggingface-hub<0.36' einops jsonlines 'draccus==0.10.0' \
        gymnasium deepdiff termcolor 'av<16' accelerate imageio h5py tqdm tensorboard tensorboardX psutil \
        packaging safetensors pyserial pynput six pyyaml matplotlib 'zarr<3' 'numcodecs<0.16'
    "${pip[@]}" deltalake duckdb pyarrow scipy
    "${pip[@]}" --no-deps --editable .
    touch "$venv/done"
fi

for format in lerobot hdf5 zarr; do
    .venv/bin/graspdb export "$format" "$scratch/$format" --db "$db" --split object --fps 30
done
"$venv/bin/python" tests/exports/check_lerobot.py "$scratch/lerobot"
"$venv/bin/python" tests/exports/check_robomimic.py "$scratch/hdf5"
"$venv/bin/python" tests/exports/check_zarr.py "$scratch/zarr"
"$venv/bin/python" tests/exports/check_training.py "$db" "$scratch/lerobot"
