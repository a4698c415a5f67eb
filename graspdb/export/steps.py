"""Episodes as trainers want them: even in time, of fixed lengths, states with the actions that follow."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb.export.items import Episode, Floats
from graspdb.export.options import ExportOptions
from graspdb.export.registry import Feature
from graspdb.export.resample import Samples, rotated, sample, straight
from graspdb_schemas.vocabulary import CONFIGURATION, N_Q, SITES

Floats32 = NDArray[np.float32]
Truths = NDArray[np.bool_]

STATE: Final = "observation.state"
ENVIRONMENT: Final = "observation.environment_state"
ACTION: Final = "action"
KNOWN: Final = ("hand_known", "object_known", "contact_known")
"""Truth values of each step with ``missing="mask"``: whether that was known, or is filled."""

ENVIRONMENT_NAMES: Final = (
    *(f"object_{axis}" for axis in ("x", "y", "z", "qw", "qx", "qy", "qz")),
    *(f"{site}_touches" for site in SITES),
)
SITE_NAMES: Final = tuple(f"{site}_{axis}" for site in SITES for axis in "xyz")

FEWEST: Final = 2
"""Steps that an episode has at least: one to act in, and what the action leads to."""


@dataclass(frozen=True, eq=False)
class Steps:
    """An episode at an even rate, all of it known or filled.

    Attributes
    ----------
    state : ndarray of float32, shape (n, s)
        The hand, as its configuration or as the centres of its sites.
    environment : ndarray of float32, shape (n, 27)
        Position and quaternion (w, x, y, z) of the object, then which of the 20 sites touch, 1 or 0.
    action : ndarray of float32, shape (n, s)
        State of the next step; the last step's is its own.
    known : ndarray of bool, shape (n, 3)
        Whether hand, object and contacts were known, or are filled.
    start : float
        Time of the first step in the recording [s].
    dropped : int
        Steps that were left out since something was not known in them or beyond them.
    """

    state: Floats32
    environment: Floats32
    action: Floats32
    known: Truths
    start: float
    dropped: int

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.state)

    def columns(self, missing: str) -> dict[str, Floats32 | Truths]:
        """Return what trainers see, by name, a row a step; with ``missing="mask"`` what is known as well."""
        seen: dict[str, Floats32 | Truths] = {
            STATE: self.state,
            ENVIRONMENT: self.environment,
            ACTION: self.action,
        }
        return seen | (dict(zip(KNOWN, self.known.T, strict=True)) if missing == "mask" else {})


@dataclass(frozen=True)
class Refused:
    """Why an episode has no steps.

    Attributes
    ----------
    reason : str
        In words that stand behind a number of episodes.
    """

    reason: str


STATIC: Final = Refused("episodes of one instant, which no action follows")
NO_ANGLES: Final = Refused(
    "episodes of hands without joint angles (import them with --fit, or export with --state sites)"
)
NOT_KNOWN: Final = Refused("episodes without two steps in a row in which all is known")


def steps_of(episode: Episode, options: ExportOptions) -> Steps | Refused:
    """Return an episode at the rate asked for, without what is not known or with it filled.

    With ``missing="drop"`` it is the longest run in which hand, object and contacts are known. With
    ``missing="mask"`` nothing is left out; what is not known is held from the last step in which it was, or
    from the first one.

    Parameters
    ----------
    episode : Episode
        As recorded.
    options : ExportOptions
        `fps`, `state` and `missing` count.
    """
    if episode.n_frames < FEWEST or not np.isfinite(episode.rate):
        return STATIC
    if options.state == "configuration" and not np.isfinite(episode.q).any():
        return NO_ANGLES
    samples = sample(episode.time, options.fps or 1)
    state = _state(episode, samples, options.state)
    pose = np.hstack(
        [straight(episode.object_position, samples), rotated(episode.object_quaternion, samples)]
    )
    touching = episode.touching[samples.nearest]
    known: Truths = np.stack([np.isfinite(part).all(axis=1) for part in (state, pose, touching)], axis=1)
    masked = options.missing == "mask"
    start, end = (0, len(known)) if masked else longest_run(np.logical_and.reduce(known, axis=1))
    if end - start < FEWEST or (masked and not known[:, :2].any(axis=0).all()):
        return NOT_KNOWN
    kept = slice(start, end)
    hand: Floats32 = _held(state[kept], known[kept, 0]).astype(np.float32)
    held = [_held(pose[kept], known[kept, 1]), np.nan_to_num(_held(touching[kept], known[kept, 2]))]
    return Steps(
        state=hand,
        environment=np.hstack(held).astype(np.float32),
        action=np.concatenate([hand[1:], hand[-1:]]),
        known=known[kept],
        start=float(episode.time[0]) + start / (options.fps or 1),
        dropped=len(known) - (end - start),
    )


def step_columns(options: ExportOptions) -> tuple[str, ...]:
    """Return the columns of `frames` that steps are made of."""
    hand = "sites" if options.state == "sites" else "q"
    return (hand, "object_position", "object_quaternion", "touching")


def _state(episode: Episode, samples: Samples, kind: str) -> Floats:
    """Return the hand at new times, shape (n, s)."""
    if kind == "sites":
        return straight(episode.sites, samples).reshape(len(samples.before), -1)
    q = straight(episode.q, samples)
    q[:, 3:7] = rotated(episode.q[:, 3:7], samples)
    return q


def longest_run(truths: Truths) -> tuple[int, int]:
    """Return begin and end of the longest run of true values, the first of those as long; (0, 0) for none."""
    edges = np.flatnonzero(np.diff(truths.astype(np.int8), prepend=0, append=0))
    if not len(edges):
        return 0, 0
    starts, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - starts))
    return int(starts[longest]), int(ends[longest])


def _held(values: Floats, known: Truths) -> Floats:
    """Return values with those not known held from the last one known, or from the first."""
    if known.all() or not known.any():
        return values
    last = np.maximum.accumulate(np.where(known, np.arange(len(known)), 0))
    last[: np.argmax(known)] = np.argmax(known)
    return values[last]


def state_names(n_state: int, kind: str) -> tuple[str, ...]:
    """Return the names of the numbers of a state."""
    if kind == "sites":
        return SITE_NAMES
    return CONFIGURATION if n_state == N_Q else tuple(f"q_{i}" for i in range(n_state))


def step_features(n_state: int, options: ExportOptions) -> list[Feature]:
    """Return what steps hold, for the card."""
    configuration = options.state == "configuration"
    unit, what = (
        ("m, 1, rad", "configuration of the hand") if configuration else ("m", "centres of the sites")
    )
    names = ", ".join(state_names(n_state, options.state)[:8])
    features = [
        Feature(STATE, "float32", f"({n_state},)", unit, f"{what}, lab frame: {names} ..."),
        Feature(
            ENVIRONMENT,
            "float32",
            f"({len(ENVIRONMENT_NAMES)},)",
            "m, 1, 1",
            "object in the lab frame: position, quaternion w x y z; then which of the 20 sites touch",
        ),
        Feature(ACTION, "float32", f"({n_state},)", unit, "state of the next step; the last step's own"),
    ]
    if options.missing == "mask":
        features += [
            Feature(name, "bool", "(1,)", "", f"{name.partition('_')[0]} known, or filled") for name in KNOWN
        ]
    return features
