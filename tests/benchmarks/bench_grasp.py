"""One grasp from gaps to quality, real grasps with a feature, and the paper's first experiment."""

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from harness import Result, benchmark

sys.path.append(str(Path(__file__).parents[1]))
from dexycb import THICKNESS, find_all, prepare_objects, read_grasps
from typed_grasps import told_types

import graspdb
from graspdb.ingestion import ingest
from graspdb.simulate import simulate_session
from graspdb.validation.contacts import contact_errors
from graspdb_ingest.keypoints import static_grasp
from graspdb_ingest.parameters import IngestParameters

DATA = Path(os.environ.get("GRASPDB_TEST_DATA", Path(__file__).parents[3] / "shared" / "data"))
GRASPS = DATA / "dexycb-grasps"


@benchmark("grasp quality")
def one_grasp() -> list[Result]:
    """Time contacts, hull, feature and quality of real grasps, one by one."""
    if not GRASPS.is_dir():
        return []
    parameters = IngestParameters()
    objects = prepare_objects(GRASPS, parameters)
    seconds = []
    for name, grasps in read_grasps(GRASPS).items():
        for described in grasps[::4]:
            tries = []
            for _ in range(3):
                start = process_time()
                static_grasp(described, objects[name], parameters)
                tries.append(process_time() - start)
            seconds.append(min(tries))
    note = f"bar 20 ms; CPU time, least of three, {len(seconds)} real grasps"
    return [
        Result(
            "hull, feature and quality of a grasp, median",
            1e3 * float(np.median(seconds)),
            None,
            "ms",
            note=note,
        ),
        Result(
            "the same, 95 % of the grasps", 1e3 * float(np.quantile(seconds, 0.95)), None, "ms", note=note
        ),
    ]


@benchmark("real grasps with a feature")
def real_features() -> list[Result]:
    """Count real grasps whose feature has 30 points or more."""
    if not GRASPS.is_dir():
        return []
    results = []
    for radii, thickness in (("given", THICKNESS), ("estimated", None)):
        points = np.array([len(grasp.feature.points) for _, _, grasp in find_all(GRASPS, thickness)])
        share = float(100 * np.mean(points >= 30))
        name = f"grasps with a feature of 30 points, {radii} radii"
        note = f"bar 96 %; {np.sum(points >= 30)} of {len(points)} grasps of DexYCB"
        results.append(Result(name, share, None, "%", better="more", note=note))
    return results


@benchmark("grasp types")
def grasp_types() -> list[Result]:
    """Tell the types of simulated grasps of known kinds, by eight hands."""
    told = list(told_types(tuple(np.linspace(0.168, 0.203, 8)), seed=0))
    named = [one for one in told if one.typed.confidence is not None]
    right = 100 * float(np.mean([one.right for one in named]))
    confidence = 100 * float(np.mean([one.typed.confidence for one in named]))
    counts = f"{len(named)} of {len(told)} grasps of 15 kinds get a type"
    share = 100 * len(named) / len(told)
    sure = f"peer: their mean confidence, which must not be above; {counts}"
    return [
        Result("grasps that get a type", share, None, "%", better="more", note=counts),
        Result("of these, right", right, confidence, "%", better="more", note=sure),
    ]


@benchmark("first experiment")
def first_experiment() -> list[Result]:
    """Simulate four pairs of digits, three subjects, five trials each, and validate their contact points."""
    with TemporaryDirectory() as folder:
        session = simulate_session(Path(folder) / "s", subjects=3, trials=5, experiment="force_panels")
        ingest(session.path, Path(folder) / "db", workers=os.cpu_count() or 1)
        with graspdb.open(Path(folder) / "db") as database:
            errors = contact_errors(database)
    results = []
    estimates = {
        "all contact points": "all_points",
        "weighted as pads press": "weighted",
        "most distal contact point": "most_distal",
    }
    for title, name in estimates.items():
        means = np.array([getattr(error, name).mean for error in errors])
        note = "bar 3 mm; peer: the paper's Table I, mean 3.7, 2.1 to 5.0 mm"
        greatest, mean = 1e3 * float(means.max()), 1e3 * float(means.mean())
        results.append(Result(f"greatest mean error, {title}", greatest, 5.0, "mm", note=note))
        results.append(Result(f"mean error, {title}", mean, 3.74, "mm", note=note))
    return results
