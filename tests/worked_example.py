"""A small database whose answers are worked out by hand: tests compare with them, docs/queries.md shows them.

Anna and Ben grasp a mug and a jug. Each object is five points in a row, 1 cm apart. Every trial has six
frames, 0.1 s apart; the hand opens to 10 cm at 0.2 s, and lifts at 0.5 s.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa
from handmade import rows, session_tables, trial_tables

from graspdb.store import Store
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.vocabulary import CONFIGURATION, DIGIT_OF_SITE, SITES

TIMES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
APERTURES = (0.04, 0.09, 0.10, 0.07, 0.06, 0.05)
SPACING = 0.01
FAR, TOUCHING = 0.02, 0.001


@dataclass(frozen=True)
class Grasp:
    """One grasp: who, what, which site on which point of the object, since when each digit."""

    subject: str
    object: str
    number: int
    contacts: Mapping[str, int]
    onsets: Mapping[str, float]
    feature: Sequence[int] | None
    index_mcp: float
    thumb_ip: float
    hull_volume: float
    side: str = "right"
    quality: Mapping[str, float] = field(default_factory=dict)
    trial: Mapping[str, Any] = field(default_factory=dict)


GRASPS = (
    Grasp(
        "anna", "mug", 1, {"thumb_tip": 0, "index_tip": 4}, {"thumb": 0.3, "index": 0.4},
        [0, 1, 2], -0.4, -0.1, 1e-5, quality={"epsilon": 0.1},
    ),
    Grasp(
        "anna", "mug", 2, {"thumb_tip": 0, "index_tip": 4, "index_pip": 2}, {"thumb": 0.2, "index": 0.4},
        [1, 2, 3], -0.4, 0.0, 3e-5, quality={"epsilon": 0.3},
    ),
    Grasp(
        "ben", "mug", 1, {"thumb_tip": 1, "index_tip": 3}, {"thumb": 0.3, "index": 0.3},
        [2, 3], -0.4, 0.1, 2e-5, quality={"epsilon": 0.2, "volume": 0.01},
    ),
    Grasp(
        "ben", "mug", 2,
        {"thumb_tip": 0, "index_tip": 4, "middle_tip": 4, "ring_tip": 4, "little_tip": 4},
        {"thumb": 0.3, "index": 0.4, "middle": 0.4, "ring": 0.4, "little": 0.5},
        None, 0.4, -0.1, 9e-5, trial={"residual_rms": 0.006},
    ),
    Grasp(
        "anna", "jug", 1, {"thumb_tip": 0, "ring_tip": 3}, {"thumb": 0.3, "ring": 0.4},
        [0, 1], 0.4, 0.0, 4e-5,
    ),
    Grasp(
        "ben", "jug", 1, {"thumb_tip": 0, "ring_tip": 3}, {"thumb": 0.4, "ring": 0.3},
        [0, 1], 0.4, 0.1, 6e-5, side="left",
    ),
)  # fmt: skip


def build(path: Path) -> None:
    """Create the database in a folder that is not there."""
    store = Store.create_or_open(path)
    store.commit_session(session_tables(objects=["mug", "jug"], size=SPACING))
    failed = {"status": "rejected", "reasons": ["hand not tracked"], "missing_fraction": 0.5, "n_grasps": 0}
    store.commit_trials(
        [
            *(_trial(grasp) for grasp in GRASPS),
            _without_grasp(trial_tables(3, **failed, residual_rms=None)),
            _without_grasp(trial_tables(2, subject="ben", object_="jug", n_grasps=0)),
            trial_tables(9, object_=None, n_grasps=0),
        ]
    )


def _trial(grasp: Grasp) -> TrialTables:
    made = trial_tables(
        grasp.number, subject=grasp.subject, object_=grasp.object, sites=list(grasp.contacts), **grasp.trial
    )
    key = made.tables["trials"]["trial"][0].as_py()
    named = {"grasp": f"{key}/{grasp.side}/0", "side": grasp.side}
    described = {
        **_only(made.tables["grasps"]),
        **named,
        "snapshot_frame": 5,
        "snapshot_time": 0.5,
        "onset_time": min(grasp.onsets.values()),
        "lift_time": 0.5,
        "contact_threshold": 0.004,
        "grip_aperture": APERTURES[-1],
        "q": _configuration(grasp.index_mcp, grasp.thumb_ip),
        "grasp_type": "palmar pinch" if set(grasp.onsets) == {"thumb", "index"} else None,
        "hull_volume": grasp.hull_volume,
        "box_volume": 2 * grasp.hull_volume,
        "ellipsoid_volume": 3 * grasp.hull_volume,
        "sphere_volume": 4 * grasp.hull_volume,
        "feature_area": 4e-6 * len(grasp.feature or ()),
        "force_closure": len(grasp.contacts) > 2,
        "quality": list(grasp.quality.items()),
    }
    contacts = [
        {**row, "grasp": named["grasp"], "point": point, "position": [SPACING * point, 0.0, 0.0]}
        for row, point in zip(made.tables["contacts"].to_pylist(), grasp.contacts.values(), strict=True)
    ]
    feature = {**_only(made.tables["features"]), "grasp": named["grasp"], "points": grasp.feature}
    return TrialTables(
        {
            **made.tables,
            "frames": _frames(key, grasp),
            "grasps": rows("grasps", described),
            "contacts": rows("contacts", *contacts),
            "features": rows("features", feature),
            "contact_events": rows("contact_events", *_events(named["grasp"], key, grasp)),
            "contact_maps": rows("contact_maps", _contact_map(named["grasp"], key, grasp)),
        }
    )


def _events(name: str, trial: str, grasp: Grasp) -> list[dict[str, Any]]:
    """Return a contact of every site since the onset of its digit; it holds when the trial ends."""
    digits = dict(zip(SITES, DIGIT_OF_SITE, strict=True))
    return [
        {
            "trial": trial,
            "side": grasp.side,
            "grasp": name,
            "site": site,
            "digit": digits[site],
            "onset_time": grasp.onsets[digits[site]],
            "first_time": grasp.onsets[digits[site]],
            "last_time": TIMES[-1],
            "before": "free",
            "after": "trial",
        }
        for site in grasp.contacts
    ]


def _contact_map(name: str, trial: str, grasp: Grasp) -> dict[str, Any]:
    """Return the map of a hand that is 1 mm above the points that it touches, and 5 mm above the others."""
    return {
        "grasp": name,
        "trial": trial,
        "session": "s",
        "object": grasp.object,
        "points": list(range(5)),
        "gaps": [TOUCHING if point in grasp.contacts.values() else 0.005 for point in range(5)],
    }


def _frames(trial: str, grasp: Grasp) -> pa.Table:
    """Return six frames in which digits touch from their onset on, and a mug bends the index finger."""
    bend = 1.0 if grasp.object == "mug" else 0.0
    return rows(
        "frames",
        *(
            {
                "trial": trial,
                "side": grasp.side,
                "frame": i,
                "time": time,
                "q": _configuration(bend * time, 0.0),
                "sites": [[aperture if site == "index_tip" else 0.0, 0.0, 0.0] for site in SITES],
                "gap": [
                    TOUCHING if site in grasp.contacts and time >= grasp.onsets[digit] else FAR
                    for site, digit in zip(SITES, DIGIT_OF_SITE, strict=True)
                ],
            }
            for i, (time, aperture) in enumerate(zip(TIMES, APERTURES, strict=True))
        ),
    )


def _configuration(index_mcp: float, thumb_ip: float) -> list[float]:
    angles = {"forearm_qw": 1.0, "index_mcp_flexion": index_mcp, "thumb_ip_flexion": thumb_ip}
    return [angles.get(name, 0.0) for name in CONFIGURATION]


def _without_grasp(trial: TrialTables) -> TrialTables:
    return TrialTables({name: trial.tables[name] for name in ("trials", "markers", "frames")})


def _only(table: pa.Table) -> dict[str, Any]:
    [row] = table.to_pylist()
    return dict(row)
