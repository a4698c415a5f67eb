"""The truth of a simulated session, in a folder beside the recordings that ingest never reads."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspdb.simulate.arrays import Floats
from graspdb.simulate.glove import GloveTruth
from graspdb.simulate.measurement import NoiseParameters, Swap
from graspdb.simulate.motion import Events
from graspdb.simulate.subjects import SimulatedSubject, placements_of
from graspdb_ingest.hand import HandDimensions
from graspdb_schemas.errors import RecordingError
from graspdb_schemas.vocabulary import Side

TRUTH: Final = "truth"
"""Folder of the truth inside a simulated session."""

ARRAYS: Final[dict[str, type[np.generic]]] = {
    "times": np.float64,
    "q": np.float64,
    "sites": np.float32,
    "markers": np.float32,
    "object_position": np.float64,
    "object_rotation": np.float64,
    "gap": np.float32,
    "contact": np.bool_,
    "occluded": np.bool_,
}
"""The arrays of a trial's truth and how they are stored; single precision is exact to 0.1 micrometres."""


@dataclass(frozen=True)
class TrialTruth:
    """What really happened in a trial; lab frame, SI units.

    Attributes
    ----------
    trial, subject, object, kind : str
        Names of trial, subject and object; kind of grasp.
    repetition : int
        Which time this subject grasps this object in this way.
    side : Side
        The hand.
    times : ndarray, shape (n_frames,)
        Time of each frame [s].
    q : ndarray, shape (n_frames, 30)
        Configurations of the hand, in the order of CONFIGURATION.
    sites : ndarray, shape (n_frames, 20, 3)
        Centres of the spheres [m].
    marker_labels : tuple of str
        Hand markers, then the object's.
    markers : ndarray, shape (n_frames, n_markers, 3)
        True marker positions, skin movement included [m].
    object_position, object_rotation : ndarray, shape (n_frames, 3) and (n_frames, 4)
        world_from_object: translation [m] and quaternion (w, x, y, z).
    gap : ndarray, shape (n_frames, 20)
        Signed distance of each sphere to the object's surface [m].
    contact : ndarray of bool, shape (n_frames, 20)
        Where a sphere touches.
    occluded : ndarray of bool, shape (n_frames, n_markers)
        Where a marker was not recorded.
    swaps : tuple of Swap
        Stretches with exchanged labels.
    events : Events
        When things happened.
    contacts : tuple of str
        Sites that touch at the onset of lift.
    glove : GloveTruth or None
        What is wrong with the data glove, where the hand wore one.
    """

    trial: str
    subject: str
    object: str
    kind: str
    repetition: int
    side: Side
    times: Floats
    q: Floats
    sites: Floats
    marker_labels: tuple[str, ...]
    markers: Floats
    object_position: Floats
    object_rotation: Floats
    gap: Floats
    contact: NDArray[np.bool_]
    occluded: NDArray[np.bool_]
    swaps: tuple[Swap, ...]
    events: Events
    contacts: tuple[str, ...]
    glove: GloveTruth | None = None


@dataclass(frozen=True)
class SessionTruth:
    """The truth of a session.

    Attributes
    ----------
    seed : int
        Seed of everything random.
    experiment : str
        ``objects`` or ``force_panels``.
    rate : float
        Frames per second [Hz].
    noise : NoiseParameters
        What was done to the markers.
    subjects : mapping of str to SimulatedSubject
        True hands, forearm markers included.
    trials : mapping of str to TrialTruth
        The trials by name.
    """

    seed: int
    experiment: str
    rate: float
    noise: NoiseParameters
    subjects: Mapping[str, SimulatedSubject]
    trials: Mapping[str, TrialTruth]


def save_trial(directory: Path, truth: TrialTruth) -> None:
    """Write one trial's arrays as ``truth/<trial>.npz`` and the rest as ``truth/<trial>.json``."""
    folder = directory / TRUTH
    folder.mkdir(exist_ok=True)
    arrays = {name: getattr(truth, name).astype(kind) for name, kind in ARRAYS.items()}
    np.savez(folder / f"{truth.trial}.npz", allow_pickle=False, **arrays)
    rest = {k: v for k, v in vars(truth).items() if k not in ARRAYS}
    rest |= {"swaps": [asdict(swap) for swap in truth.swaps], "events": asdict(truth.events)}
    rest["glove"] = None if truth.glove is None else asdict(truth.glove)
    _write_json(folder / f"{truth.trial}.json", rest)


def save_session(directory: Path, truth: SessionTruth) -> None:
    """Write what belongs to the session as a whole as ``truth/session.json``."""
    content = {
        "seed": truth.seed,
        "experiment": truth.experiment,
        "rate": truth.rate,
        "noise": asdict(truth.noise),
        "subjects": {name: _subject_as_json(subject) for name, subject in truth.subjects.items()},
        "trials": list(truth.trials),
    }
    (directory / TRUTH).mkdir(exist_ok=True)
    _write_json(directory / TRUTH / "session.json", content)


def load_truth(session_dir: str | Path) -> SessionTruth:
    """Read the truth of a simulated session.

    Parameters
    ----------
    session_dir : str or Path
        The session's folder.

    Raises
    ------
    RecordingError
        If the folder holds no truth.
    """
    folder = Path(session_dir) / TRUTH
    path = folder / "session.json"
    if not path.is_file():
        raise RecordingError(
            path, "there is no truth here", "Name a folder that graspdb simulate has written."
        )
    content = json.loads(path.read_text(encoding="utf-8"))
    noise: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in content["noise"].items()}
    return SessionTruth(
        seed=content["seed"],
        experiment=content["experiment"],
        rate=content["rate"],
        noise=NoiseParameters(**noise),
        subjects={name: _subject_from_json(name, s) for name, s in content["subjects"].items()},
        trials={name: _load_trial(folder, name) for name in content["trials"]},
    )


def _load_trial(folder: Path, name: str) -> TrialTruth:
    rest = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    rest |= {
        "side": Side(rest["side"]),
        "marker_labels": tuple(rest["marker_labels"]),
        "contacts": tuple(rest["contacts"]),
        "swaps": tuple(Swap(**swap) for swap in rest["swaps"]),
        "events": Events(**rest["events"]),
        "glove": None if rest["glove"] is None else GloveTruth(**rest["glove"]),
    }
    with np.load(folder / f"{name}.npz") as arrays:
        return TrialTruth(**rest, **{key: arrays[key] for key in ARRAYS})


def _subject_as_json(subject: SimulatedSubject) -> dict[str, Any]:
    return {
        "side": subject.side,
        "hand_length": subject.dimensions.hand_length,
        "hand_breadth": subject.dimensions.hand_breadth,
        "joint_thickness": dict(subject.dimensions.joint_thickness),
        "proportions": dict(subject.dimensions.proportions),
        "forearm_markers": {k: p.offset for k, p in subject.placements.items() if p.offset is not None},
    }


def _subject_from_json(name: str, content: dict[str, Any]) -> SimulatedSubject:
    dimensions = HandDimensions(
        content["hand_length"],
        content["hand_breadth"],
        content["joint_thickness"],
        content["proportions"],
    )
    forearm = {k: tuple(offset) for k, offset in content["forearm_markers"].items()}
    return SimulatedSubject(name, Side(content["side"]), dimensions, placements_of(forearm))


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=1, sort_keys=True) + "\n", encoding="utf-8")
