"""Features of the same part of an object, found across simulated objects and people.

People's postures differ here as those of real people do who grasp at one place (`variety`). What part a
feature is of follows from where its points lie on the object, not from the kind of grasp: two features are of
the same part if the shares of their areas that lie on handle, cap, neck, rim and side overlap by half.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from harness import Result, benchmark
from numpy.typing import NDArray

import graspdb
from graspdb.database import Database
from graspdb.simulate import simulate_session
from graspdb.simulate.objects import SimulatedObject
from graspdb.simulate.surface import Surface

SUBJECTS = 5
VARIETY = 1.0
SEED = 11
RATE = 60.0

PARTS = ("handle", "cap", "neck", "rim", "side")
RIM = 0.015
"""Reach of a rim below the edge: what a finger's last pad covers [m]."""

SHARED = 0.5

Floats = NDArray[np.float64]


@benchmark("similar parts")
def simulated_parts() -> list[Result]:
    """Let every feature look for those of the same part, of other subjects on other objects."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        session = simulate_session(
            folder / "session", subjects=SUBJECTS, seed=SEED, rate=RATE, variety=VARIETY
        )
        graspdb.ingest(session.path, folder / "grasps", workers=2)
        with graspdb.open(folder / "grasps") as database:
            return [
                result
                for strict in (True, False)
                for result in _results(database, shares_of_parts(database, session.objects), strict)
            ]


def _results(database: Database, shares: dict[str, Floats], strict: bool) -> list[Result]:
    found = precisions(database, shares, strict)
    mean = {by: float(np.mean(values)) for by, values in found.items()}
    where = "other subject and object" if strict else "other subject"
    note = f"{where}; {len(found['feature'])} queries; clearly above the peer"
    results = [
        Result(f"same part, {where}, peer: {peer}", mean["feature"], mean[peer], "mAP", "more", note)
        for peer in ("random", "size", "posture")
    ]
    every = f"{where}; feature, posture and contacts together; peer: posture"
    return [*results, Result(f"same part, {where}, all", mean["all"], mean["posture"], "mAP", "more", every)]


def shares_of_parts(database: Database, bodies: Sequence[SimulatedObject]) -> dict[str, Floats]:
    """Return for each grasp the shares of its feature's area that lie on each part, shape (5,)."""
    table = database.sql("SELECT object, position, area FROM object_points ORDER BY object, point").table
    owners = np.array(table["object"].to_pylist())
    positions, areas = np.array(table["position"].to_pylist()), table["area"].to_numpy()
    parts = {body.name: part_of_points(body, positions[owners == body.name]) for body in bodies}
    shares = {}
    rows = database.sql(
        "SELECT grasp, object, points FROM features WHERE len(points) > 0 ORDER BY grasp"
    ).rows()
    for grasp, name, points in rows:
        area = areas[owners == name][points]
        on = np.bincount(parts[name][points], area, minlength=len(PARTS))
        shares[grasp] = on / on.sum()
    return shares


def part_of_points(body: SimulatedObject, points: Floats) -> NDArray[np.int64]:
    """Return for each point of a simulated object the part that it lies on, as a place in `PARTS`."""
    measures, height = body.measures, points[:, 2]
    found = np.full(len(points), PARTS.index("side"))
    if body.name == "mug":
        found[height > measures["height"] - RIM] = PARTS.index("rim")
    else:
        found[height > measures["shoulder"]] = PARTS.index("neck")
        found[height >= measures["cap_low"]] = PARTS.index("cap")
    if len(body.parts) > 1:
        wall, handle = (np.abs(Surface((part,)).distance(points)) for part in body.parts)
        found[handle < wall] = PARTS.index("handle")
    return found


def precisions(database: Database, shares: dict[str, Floats], strict: bool) -> dict[str, list[float]]:
    """Return the average precision of every query that has something to find, by what it was ranked by."""
    rows = database.sql(
        "SELECT grasp, subject, object, extents, area FROM features JOIN grasps USING (grasp)"
    )
    described = {row["grasp"]: row for row in rows.table.to_pylist()}
    sizes = {key: np.append(row["extents"], np.sqrt(row["area"])) for key, row in described.items()}
    rng = np.random.default_rng(0)
    found: dict[str, list[float]] = {by: [] for by in ("feature", "posture", "all", "size", "random")}
    for key, share in shares.items():
        mine = described[key]
        others = [
            other
            for other in shares
            if described[other]["subject"] != mine["subject"]
            and not (strict and described[other]["object"] == mine["object"])
        ]
        wanted = np.array([np.minimum(share, shares[other]).sum() >= SHARED for other in others])
        if not wanted.any():
            continue
        for by in ("feature", "posture", "all"):
            ranks = {hit.grasp: hit.rank for hit in database.similar(key, 1000, by=by).hits}
            costs = [float(ranks.get(other, len(ranks) + 1)) for other in others]
            found[by].append(_average_precision(wanted, costs))
        found["size"].append(
            _average_precision(wanted, [float(np.linalg.norm(sizes[k] - sizes[key])) for k in others])
        )
        found["random"].append(
            float(np.mean([_average_precision(wanted, rng.random(len(others))) for _ in range(20)]))
        )
    return found


def _average_precision(wanted: NDArray[np.bool_], costs: Sequence[float] | Floats) -> float:
    places = np.flatnonzero(wanted[np.argsort(costs, kind="stable")])
    return float(np.mean((np.arange(len(places)) + 1) / (places + 1)))
