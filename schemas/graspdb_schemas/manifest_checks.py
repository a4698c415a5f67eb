"""What a JSON Schema cannot say of a manifest: sizes that hands have, and names that must exist.

Every check leaves alone what is not of the right type, since the schema has reported it.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspdb_schemas.errors import Problem, nearest
from graspdb_schemas.manifest_yaml import table
from graspdb_schemas.units import METRES_PER
from graspdb_schemas.vocabulary import (
    DIGIT_OF_SITE,
    FOREARM_MARKERS,
    SEGMENT_OF_SITE,
    SEGMENTS,
    SEGMENTS_OF_DIGIT,
    SITES,
    Side,
)

_HAND_LENGTH: Final = (0.05, 0.35)
_HAND_BREADTH: Final = (0.02, 0.20)
_THICKNESS: Final = (0.003, 0.06)
_MARKER_REACH: Final = (0.0, 5.0)
_MASS: Final = 200.0
_FRICTION: Final = 4.0
"""More than skin has on any dry solid."""
_OFF_LINE: Final = 0.001
"""Markers nearer than this to one line fix no rotation [m]."""


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def vector(value: object) -> tuple[float, float, float] | None:
    """Return a list of three numbers as floats, or None."""
    if not isinstance(value, list) or len(value) != 3:
        return None
    x, y, z = (_number(item) for item in value)
    return None if x is None or y is None or z is None else (x, y, z)


def value_problems(manifest: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield what is wrong with sizes, directions, names and times of a manifest."""
    yield from _up(manifest)
    units = manifest.get("units")
    metres = METRES_PER.get(units) if isinstance(units, str) else None
    if metres is not None:
        yield from _sizes(manifest, str(units))
    yield from _placements(manifest)
    yield from _marker_names(manifest)
    for name, entry in table(manifest.get("subjects")).items():
        yield from _model(f"subjects.{name}", table(entry))
    for name, entry in table(manifest.get("objects")).items():
        yield from _object(f"objects.{name}", table(entry), set(hand_labels(manifest)), metres)
    yield from _trials(manifest)


def _up(manifest: Mapping[str, Any]) -> Iterator[Problem]:
    up = vector(manifest.get("up"))
    if up is not None and not 1e-9 < math.hypot(*up) < math.inf:
        yield Problem("up", str(list(up)), "a direction: a vector that is not zero, such as [0, 0, 1]")


def _sizes(manifest: Mapping[str, Any], units: str) -> Iterator[Problem]:
    for name, entry in table(manifest.get("subjects")).items():
        subject, key = table(entry), f"subjects.{name}"
        length, breadth = subject.get("hand_length"), subject.get("hand_breadth")
        yield from _size(f"{key}.hand_length", length, units, _HAND_LENGTH)
        yield from _size(f"{key}.hand_breadth", breadth, units, _HAND_BREADTH)
        long, broad = _number(length), _number(breadth)
        if long is not None and broad is not None and broad >= long > 0:
            yield Problem(f"{key}.hand_breadth", f"{breadth}", f"less than the hand's length of {length}")
        for site, thickness in table(subject.get("joint_thickness")).items():
            yield from _size(f"{key}.joint_thickness.{site}", thickness, units, _THICKNESS)
    for name, entry in table(manifest.get("objects")).items():
        for label, place in table(table(entry).get("markers")).items():
            position = vector(place)
            if position is not None:
                distance = math.hypot(*position)
                yield from _size(f"objects.{name}.markers.{label}", distance, units, _MARKER_REACH)
    for label, entry in table(manifest.get("marker_set")).items():
        offset = vector(table(entry).get("offset"))
        if offset is not None:
            yield from _size(f"marker_set.{label}.offset", math.hypot(*offset), units, (0.0, 0.5))


def _size(key: str, value: object, units: str, bounds: tuple[float, float]) -> Iterator[Problem]:
    """Report a length that no hand or handheld object has; the usual reason is a wrong unit."""
    low, high = bounds
    number = _number(value)
    if number is None or number < 0 or low <= number * METRES_PER[units] <= high:
        return
    fitting = [unit for unit, metres in METRES_PER.items() if low <= number * metres <= high]
    hint = f"; is `units` wrong? {number:g} {fitting[0]} would do" if fitting else ""
    per = METRES_PER[units]
    yield Problem(key, f"{number:g} {units}", f"{low / per:g} to {high / per:g} {units}{hint}")


def hand_labels(manifest: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the labels of the hand markers, without side."""
    custom = table(manifest.get("marker_set"))
    return tuple(custom) if custom else (*FOREARM_MARKERS, *SITES)


def _object_labels(manifest: Mapping[str, Any]) -> tuple[str, ...]:
    objects = table(manifest.get("objects")).values()
    return tuple(label for entry in objects for label in table(table(entry).get("markers")))


def _placements(manifest: Mapping[str, Any]) -> Iterator[Problem]:
    foreign = any("model" in table(entry) for entry in table(manifest.get("subjects")).values())
    for label, entry in table(manifest.get("marker_set")).items():
        at, segment = table(entry).get("at"), table(entry).get("segment")
        if isinstance(segment, str) and segment and segment not in SEGMENTS and not foreign:
            allowed = ", ".join(SEGMENTS) + nearest(segment, SEGMENTS)
            yield Problem(f"marker_set.{label}.segment", repr(segment), allowed)
            continue
        if isinstance(at, str) and at in SEGMENT_OF_SITE and isinstance(segment, str):
            carriers = _carriers(at)
            if segment not in carriers:
                allowed = f"a segment beside {at}: {' or '.join(carriers)}"
                yield Problem(f"marker_set.{label}.segment", repr(segment), allowed)


def _model(key: str, subject: Mapping[str, Any]) -> Iterator[Problem]:
    model = subject.get("model")
    if model is None:
        return
    if isinstance(model, str) and subject.get("hand") == "both":
        allowed = (
            "the hand that the file shows, {right: file} or {left: file}, the other being its mirror image"
        )
        yield Problem(f"{key}.model", repr(model), allowed)
    if "joint_thickness" in subject:
        allowed = "nothing beside a model, whose sites have their own sizes"
        yield Problem(f"{key}.joint_thickness", "a table", allowed)


def _carriers(site: str) -> tuple[str, ...]:
    """Return the segments that meet at a site."""
    chain = ("hand", *SEGMENTS_OF_DIGIT[DIGIT_OF_SITE[SITES.index(site)]])
    i = chain.index(SEGMENT_OF_SITE[site])
    return chain[i : i + 2]


def _marker_names(manifest: Mapping[str, Any]) -> Iterator[Problem]:
    labels = hand_labels(manifest)
    sided = [f"{side}_{label}" for side in Side for label in labels]
    known = {*labels, *sided, *_object_labels(manifest)}
    for label, target in table(manifest.get("marker_names")).items():
        if isinstance(target, str) and target not in known:
            allowed = "a label of the marker set or of an object's marker" + nearest(target, sorted(known))
            yield Problem(f"marker_names.{label}", repr(target), allowed)


def _object(key: str, entry: Mapping[str, Any], taken: set[str], metres: float | None) -> Iterator[Problem]:
    markers = table(entry.get("markers"))
    for name in ("mesh_units", "markers", "center_of_mass"):
        if name in entry and "mesh" not in entry:
            allowed = "nothing without a mesh, whose unit or frame it is in"
            yield Problem(f"{key}.{name}", "a value", allowed)
    for label in sorted(taken & set(markers)):
        allowed = "a label that the hand's marker set does not have"
        yield Problem(f"{key}.markers.{label}", "a label of the hand's markers too", allowed)
    mass = _number(entry.get("mass"))
    if mass is not None and mass > _MASS:
        yield Problem(f"{key}.mass", f"{mass:g} kg", f"up to {_MASS:g} kg; is it in grams?")
    friction = _number(entry.get("friction"))
    if friction is not None and friction > _FRICTION:
        yield Problem(f"{key}.friction", f"{friction:g}", f"up to {_FRICTION:g}; is it in percent?")
    positions = {label: place for label, raw in markers.items() if (place := vector(raw)) is not None}
    if metres is not None and len(positions) == len(markers) >= 3:
        yield from _shape(f"{key}.markers", list(positions), metres * np.array(list(positions.values())))


def _shape(key: str, labels: list[str], positions: NDArray[np.float64]) -> Iterator[Problem]:
    """Report markers, shape (n, 3) [m], that cannot tell how an object is turned."""
    for (i, first), (j, second) in combinations(enumerate(labels), 2):
        if np.linalg.norm(positions[i] - positions[j]) < _OFF_LINE:
            yield Problem(key, f"{first} and {second} at one place", "each marker at a place of its own")
            return
    centred = positions - positions.mean(axis=0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    if np.linalg.norm(centred - np.outer(centred @ axis, axis), axis=1).max() < _OFF_LINE:
        yield Problem(key, "markers on one line", "at least one marker 1 mm or more off the others' line")


def _trials(manifest: Mapping[str, Any]) -> Iterator[Problem]:
    trials = manifest.get("trials")
    for index, entry in enumerate(trials if isinstance(trials, list) else []):
        trial, key = table(entry), f"trials[{index}]"
        for kind in ("subject", "object"):
            names = list(table(manifest.get(f"{kind}s")))
            name = trial.get(kind)
            if isinstance(name, str) and name not in names:
                listed = ", ".join(names) or f"none, since the manifest has no {kind}s"
                yield Problem(f"{key}.{kind}", repr(name), listed + nearest(name, names))
        if "clouds" not in trial:
            yield from _shown_by_markers(key, trial.get("object"), table(manifest.get("objects")))
        yield from _hand_of_trial(key, trial, table(manifest.get("subjects")))
        start, end = _number(trial.get("start")), _number(trial.get("end"))
        if start is not None and end is not None and start >= end:
            yield Problem(f"{key}.start", f"{start:g} s", f"less than the end, {end:g} s")


def _shown_by_markers(key: str, name: object, objects: Mapping[str, Any]) -> Iterator[Problem]:
    """Report what keeps an object from being followed by markers, in a trial without clouds."""
    if not isinstance(name, str) or name not in objects:
        return
    described = table(objects[name])
    if "mesh" not in described:
        allowed = "an object with a mesh, or a trial with clouds"
        yield Problem(f"{key}.object", f"{name!r}, which has no mesh", allowed)
    elif "markers" not in described:
        allowed = "an object with markers, or a trial with clouds"
        yield Problem(f"{key}.object", f"{name!r}, which has no markers", allowed)


def _hand_of_trial(key: str, trial: Mapping[str, Any], subjects: Mapping[str, Any]) -> Iterator[Problem]:
    hand, subject = trial.get("hand"), trial.get("subject")
    recorded = table(subjects.get(subject)).get("hand") if isinstance(subject, str) else None
    if isinstance(hand, str) and recorded in ("right", "left") and hand != recorded:
        yield Problem(f"{key}.hand", repr(hand), f"{recorded}, the hand of subject {subject}")
