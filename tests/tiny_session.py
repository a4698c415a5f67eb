"""A session whose ingest takes seconds: half a second of one grasp, under many names."""

import shutil
from pathlib import Path

import yaml

from graspdb.simulate import simulate_session


def write_tiny_session(
    folder: Path, n_trials: int = 20, name: str = "tiny", seed: int = 3, rate: float = 20.0
) -> Path:
    """Write a session of `n_trials` trials of half a second, and a recording to calibrate the hand from."""
    simulate_session(
        folder, subjects=1, trials=1, seed=seed, rate=rate, objects=["bottle"], kinds=["side_power"]
    )
    manifest = yaml.safe_load((folder / "session.yaml").read_text())
    entry = manifest["trials"][0]
    recording = folder / entry["file"]
    shutil.rmtree(folder / "truth")
    entries = []
    for number in range(n_trials):
        file = f"trials/take_{number:02}.c3d"
        shutil.copy(recording, folder / file)
        start = 2.5 + 0.05 * (number % 10)
        entries.append({**entry, "file": file, "repetition": number, "start": start, "end": start + 0.5})
    shutil.move(recording, folder / "calibration.c3d")
    for subject in manifest["subjects"].values():
        subject["calibration"] = ["calibration.c3d"]
    manifest |= {"id": name, "trials": entries}
    (folder / "session.yaml").write_text(yaml.safe_dump(manifest), encoding="utf-8")
    return folder
