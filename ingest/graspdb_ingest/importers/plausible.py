"""Whether key points can be those of the hand they are said to be: its size, and which hand it is.

Neither unit nor side can be trusted in files that people have written for themselves, and both show in
the key points: a hand is 0.1 to 0.3 m long, and its fingers bend and its thumb stands to one side only.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from graspdb_ingest.hand.dimensions import PLAUSIBLE_HAND_LENGTH
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.importers.base import Clip, ClipHand
from graspdb_ingest.keypoints import hand_lengths
from graspdb_schemas.errors import ImportSourceError
from graspdb_schemas.units import METRES_PER
from graspdb_schemas.vocabulary import Side

SURE: Final = 0.1
"""Chirality below which nothing is said: the fingers are straight, and the thumb lies beside them."""
SAMPLED_FRAMES: Final = 300
"""Frames of a clip that its side is judged by."""
LARGEST_DISTANCE: Final = 2.0
"""A hand further than this from an object in every frame is not of the same scene, or unit [m]."""


def chirality(key_points: Floats) -> float:
    """Return how surely hands are right (positive) or left (negative).

    Seen with the fingers up and the index to one side, fingers bend and the thumb stands towards the palm:
    for a right hand that is against the direction ``distal x radial``, for a left hand along it. The
    figure is the sum of the fingers' mean bend about the radial direction, as a sine a joint pair, and of
    the thumb's height over the palm, in lengths of the palm; the median over the frames counts, since a
    hand that is stretched in some of them says little there.

    Parameters
    ----------
    key_points : ndarray, shape (n, 21, 3)
        Key points of one hand; frames with NaN are passed over.

    Returns
    -------
    float
        0 if no frame is known.
    """
    known = key_points[np.isfinite(key_points).all(axis=(1, 2))]
    known = known[np.unique(np.linspace(0, max(0, len(known) - 1), SAMPLED_FRAMES).astype(int))[: len(known)]]
    if not len(known):
        return 0.0
    wrist, chains = known[:, 0], known[:, 1:].reshape(-1, 5, 4, 3)
    palm = chains[:, 2, 0] - wrist
    radial = _unit(chains[:, 1, 0] - chains[:, 4, 0])
    bones = _unit(np.diff(chains[:, 1:], axis=2))
    bend = np.cross(bones[:, :, :-1], bones[:, :, 1:]).sum(axis=2)
    fingers = np.einsum("nfi,ni->nf", bend, radial).mean(axis=1)
    dorsal = _unit(np.cross(palm, radial))
    height = np.einsum("ni,ni->n", chains[:, 0, 2] - chains[:, 0, 0], dorsal)
    thumb = -height / np.maximum(np.linalg.norm(palm, axis=1), 1e-9)
    return float(np.median(fingers + thumb))


def side_found(key_points: Floats) -> Side | None:
    """Return which hand key points, shape (n, 21, 3), are of; None where they do not tell."""
    found = chirality(key_points)
    if abs(found) < SURE:
        return None
    return Side.RIGHT if found > 0 else Side.LEFT


@dataclass(frozen=True)
class Checked:
    """A clip whose hands can be believed.

    Attributes
    ----------
    clip : Clip
        The clip; hands are NaN in frames in which they cannot be believed.
    notes : tuple of str
        What was left out, and why.
    """

    clip: Clip
    notes: tuple[str, ...]


def check_clip(clip: Clip, file: Path, units: str | None) -> Checked:
    """Check units and sides of a clip.

    Parameters
    ----------
    clip : Clip
        The clip.
    file : Path
        Where it comes from, for messages.
    units : str or None
        The unit that the user says the files have.

    Raises
    ------
    ImportSourceError
        If the hands' size, or their distance from the object, says that a unit is wrong or that there are
        several; if a hand is not the one it is said to be; or if no frame shows a hand.
    """
    hands, notes = [], list(clip.notes)
    for hand in clip.hands:
        good, found = _sized(hand, file, units)
        notes += found
        _check_side(replace(hand, key_points=good), file)
        hands.append(replace(hand, key_points=good))
    if all(not np.isfinite(hand.key_points).any() for hand in hands):
        raise ImportSourceError(file, f"{clip.identifier}: no frame shows a hand", "Leave this clip out.")
    checked = replace(clip, hands=tuple(hands))
    _check_distance(checked, file)
    return Checked(checked, tuple(notes))


def _sized(hand: ClipHand, file: Path, units: str | None) -> tuple[Floats, list[str]]:
    """Return the key points, NaN in frames that show no hand, and what to know of it."""
    points = hand.key_points
    whole = np.asarray(np.isfinite(points).all(axis=(1, 2)))
    if not whole.any():
        return np.full(points.shape, np.nan), []
    lengths = np.full(len(points), np.nan)
    lengths[whole] = hand_lengths(points[whole])
    usual = float(np.median(lengths[whole]))
    if not _plausible(usual):
        raise ImportSourceError(file, *_wrong_unit(hand, usual, units))
    odd = np.asarray(whole & ~((lengths >= PLAUSIBLE_HAND_LENGTH[0]) & (lengths <= PLAUSIBLE_HAND_LENGTH[1])))
    others = np.flatnonzero(odd & _other_unit(lengths / usual))
    if len(others):
        first = int(others[0])
        found = (
            f"mixed units: the {hand.side} hand is {usual:.3g} m long in most frames and "
            f"{lengths[first]:.3g} m in {len(others)} of {len(points)}, the first of them frame {first}"
        )
        raise ImportSourceError(file, found, "Bring all frames to one unit.")
    kept = np.where((whole & ~odd)[:, None, None], points, np.nan)
    return kept, list(_left_out(hand, points, whole, odd))


def _left_out(hand: ClipHand, points: Floats, whole: Bools, odd: Bools) -> Iterator[str]:
    partly = np.asarray(np.isfinite(points).any(axis=(1, 2)) & ~whole)
    if partly.any():
        yield f"{hand.side} hand: {int(partly.sum())} frames without some of the key points left out"
    if odd.any():
        yield f"{hand.side} hand: {int(odd.sum())} frames of a size that no hand has left out"


def _plausible(length: float) -> bool:
    low, high = PLAUSIBLE_HAND_LENGTH
    return low <= length <= high


def _other_unit(ratios: Floats) -> Bools:
    """Whether ratios are near a power of ten other than one."""
    with np.errstate(divide="ignore", invalid="ignore"):
        powers = np.log10(ratios)
    return np.asarray((np.abs(powers - np.round(powers)) < 0.15) & (np.round(powers) != 0))


def _wrong_unit(hand: ClipHand, length: float, units: str | None) -> tuple[str, str]:
    """Return what is wrong with a hand's size, and the remedy, with the unit that would make it right."""
    said = units or "m"
    found = f"the {hand.side} hand would be {length:.3g} m long"
    # A human hand is about 0.19 m long; the unit that brings the key points nearest to that.
    fits = {
        unit: abs(np.log(length * metres / METRES_PER[said] / 0.19)) for unit, metres in METRES_PER.items()
    }
    best = min(fits, key=lambda unit: fits[unit]) if length > 0 else said
    if best != said and _plausible(length * METRES_PER[best] / METRES_PER[said]):
        return f"{found} if its lengths were in {said}", f"They look like {best}: --units {best}"
    return found, "Check the unit, and the order of the key points: --units, --order."


def _check_side(hand: ClipHand, file: Path) -> None:
    found = side_found(hand.key_points)
    if found is None or found is hand.side:
        return
    raise ImportSourceError(
        file,
        f"key points declared to be of the {hand.side} hand are those of a {found} one "
        f"(chirality {chirality(hand.key_points):+.2f}; right is positive)",
        "Correct the side if it is wrong; if the axes are left-handed, negate one of them.",
    )


def _check_distance(clip: Clip, file: Path) -> None:
    """Refuse hands that are never near the object."""
    if clip.poses is None:
        return
    origins = clip.poses[:, :3, 3]
    distances = [np.linalg.norm(hand.key_points[:, 0] - origins, axis=1) for hand in clip.hands]
    nearest = np.concatenate(distances)
    nearest = nearest[np.isfinite(nearest)]
    if len(nearest) and nearest.min() > LARGEST_DISTANCE:
        found = f"no hand comes nearer than {nearest.min():.3g} m to the object"
        raise ImportSourceError(
            file, found, "Are the object's poses in the unit and frame of the key points?"
        )


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))
