"""Export a database in every format of files, read all of it back with the formats' libraries, and compare.

Usage: python check_files.py DB SCRATCH. Prints what was read and how far its numbers are off.
"""

import sys
import warnings
from pathlib import Path

import ezc3d
import mujoco
import numpy as np
import pyarrow.parquet as pq
import trimesh
import webdataset

import graspdb
from graspdb.export.names import path_of
from graspdb_ingest.readers.trc import read_trc
from graspdb_schemas.vocabulary import SITES

STEPS = 50
"""Steps that each scene is simulated for."""


def sites_of(database: graspdb.Database) -> dict[str, np.ndarray]:
    """Return the sites of every grasp in the object frame, by its key."""
    rows = database.sql("SELECT grasp, sites_object FROM grasps").rows()
    return {key: np.array(sites, dtype=float) for key, sites in rows}


def frames_of(database: graspdb.Database, key: str) -> np.ndarray:
    """Return the sites of a hand of a trial in the lab frame, NaN where they are not known."""
    trial, _, side = key.rpartition("/")
    statement = "SELECT sites FROM frames WHERE trial = $trial AND side = $side ORDER BY frame"
    rows = database.sql(statement, trial=trial, side=side).rows()
    return np.array([np.full((20, 3), np.nan) if sites is None else sites for (sites,) in rows], dtype=float)


def off(read: np.ndarray, wanted: np.ndarray) -> float:
    """Return the largest difference, over 1 plus the number; both must be missing in the same places."""
    assert (np.isnan(read) == np.isnan(wanted)).all()
    return float(np.nanmax(np.abs(read - wanted) / (1 + np.abs(wanted)), initial=0.0))


def check_grasps(sites: dict[str, np.ndarray], folder: Path) -> dict[str, tuple[int, float]]:
    """Compare the formats of grasps."""
    shards = [np.load(path) for path in sorted((folder / "grasps").glob("*.npz"))]
    npz = {key: s for shard in shards for key, s in zip(shard["grasp"], shard["sites"], strict=True)}
    urls = [str(path) for path in sorted((folder / "webdataset").glob("*.tar"))]
    samples = webdataset.WebDataset(urls, shardshuffle=False).decode()
    tar = {sample["json"]["grasp"]: sample["sites.npy"] for sample in samples}
    table = pq.read_table(sorted((folder / "parquet").glob("*.parquet"))).to_pylist()
    names = [[f"sites_object_{site}_{axis}" for axis in "xyz"] for site in SITES]
    rows = {row["grasp"]: np.array([[row[n] for n in name] for name in names]) for row in table}
    ply = {
        key: trimesh.load(str(path_of(folder / "ply", "", key)) + "_sites.ply", process=False).vertices
        for key in sites
    }
    for key in sites:
        assert trimesh.load_scene(str(path_of(folder / "glb", "", key)) + ".glb").geometry, key
    assert all(set(found) == set(sites) for found in (npz, tar, rows))
    return {
        name: (len(found), max(off(found[key], sites[key]) for key in sites))
        for name, found in (("grasps", npz), ("webdataset", tar), ("parquet", rows), ("ply", ply))
    }


def check_scenes(sites: dict[str, np.ndarray], folder: Path) -> str:
    """Load and step every scene; return how far its sites are off and how fast all moves."""
    distances, speeds = [], []
    for key, wanted in sites.items():
        path = Path(str(path_of(folder / "mjcf", "", key)) + ".xml")
        if not path.exists():
            continue
        model = mujoco.MjModel.from_xml_path(str(path))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        body = data.body("object")
        found = (np.array([data.site(site).xpos for site in SITES]) - body.xpos) @ body.xmat.reshape(3, 3)
        distances.append(1000 * np.linalg.norm(found - wanted, axis=1).max())
        mujoco.mj_step(model, data, STEPS)
        assert not data.warning.number.any(), path
        speeds.append(np.abs(data.qvel).max())
    return (
        f"mjcf: {len(distances)} of {len(sites)} grasps, sites {np.median(distances):.2g} mm off (median), "
        f"{max(distances):.2g} mm (most); after {STEPS} steps no warning, fastest {max(speeds):.1f} rad/s"
    )


def check_trials(database: graspdb.Database, folder: Path) -> dict[str, tuple[int, float]]:
    """Compare the formats of trials."""
    found: dict[str, list[float]] = {"trc": [], "c3d": [], "keypoints": []}
    for path in sorted((folder / "keypoints").rglob("*.npz")):
        file = np.load(path)
        key = f"{file['trial']}/{file['side']}"
        wanted = frames_of(database, key)
        wanted[~file["valid"]] = np.nan
        found["keypoints"].append(off(file["key_points"][:, 1:], wanted))
        labels = [f"site_{file['side']}_{site}" for site in SITES]
        trc, c3d = (Path(str(path_of(folder / form, "", key)) + f".{form}") for form in ("trc", "c3d"))
        if trc.exists():
            read = read_trc(trc, 1.0)
            columns = [read.labels.index(label) for label in labels]
            found["trc"].append(off(read.positions[:, columns], frames_of(database, key)))
            file = ezc3d.c3d(str(c3d))
            columns = [file["parameters"]["POINT"]["LABELS"]["value"].index(label) for label in labels]
            points = file["data"]["points"][:3].transpose(2, 1, 0)[:, columns] / 1000
            found["c3d"].append(off(points, frames_of(database, key)))
    return {name: (len(values), max(values)) for name, values in found.items()}


def main() -> None:
    """Export, read and compare."""
    warnings.simplefilter(
        "ignore", ResourceWarning
    )  # webdataset leaves the closing of files to the collector
    folder = Path(sys.argv[2])
    with graspdb.open(sys.argv[1]) as database:
        for form in (
            "grasps",
            "webdataset",
            "parquet",
            "csv",
            "ply",
            "obj",
            "glb",
            "mjcf",
            "trc",
            "c3d",
            "mot",
        ):
            database.export(form, folder / form)
        database.export("keypoints", folder / "keypoints", missing="mask")
        sites = sites_of(database)
        read = check_grasps(sites, folder) | check_trials(database, folder)
        for name, (count, most) in read.items():
            assert most < 2**-22, (name, most)
            print(f"{name}: {count} read, numbers off by {most:.1e} at most")
        print(check_scenes(sites, folder))


if __name__ == "__main__":
    main()
