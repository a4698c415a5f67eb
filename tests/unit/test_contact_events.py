"""Contact over time has three values: touching, free, unknown; and unknown is never a release."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspdb_ingest.contact_events import (
    FREE,
    TOUCHES,
    UNKNOWN,
    ContactEvent,
    contact_events,
    contact_states,
    ranks,
)
from graspdb_ingest.parameters import EventParameters

H, MARGIN, RATE = 0.004, 0.004, 100.0
PARAMETERS = EventParameters()


def states(text: str) -> np.ndarray:
    """Return states of one site, ten frames a letter: T touching, f free, u unknown."""
    values = [{"T": TOUCHES, "f": FREE, "u": UNKNOWN}[letter] for letter in text for _ in range(10)]
    return np.array(values, dtype=np.int8)[:, None]


def events(text: str, **changed: float) -> list[tuple[str, float, float, str]]:
    """Return what happens, in letters of `states`."""
    found = contact_events(states(text), RATE, replace(PARAMETERS, **changed))
    return [(e.before, e.first / 10, (e.last + 1) / 10, e.after) for e in found]


def one_site(gap: list[float], sd: list[float] | None = None) -> list[int]:
    column = None if sd is None else np.array(sd)[:, None]
    return contact_states(np.array(gap)[:, None], column, H, MARGIN)[:, 0].tolist()


def test_hysteresis() -> None:
    gap = [0.010, 0.006, 0.0039, 0.006, 0.0079, 0.0081, 0.006, 0.0041, 0.003]
    assert one_site(gap) == [0, 0, 1, 1, 1, 0, 0, 0, 1]


def test_a_gap_that_is_not_known_is_neither_contact_nor_release() -> None:
    assert one_site([0.001, np.nan, 0.001, np.nan, 0.006, 0.020]) == [1, -1, 1, -1, 0, 0]


def test_a_gap_known_worse_than_the_threshold_decides_nothing_unless_it_is_wide() -> None:
    gap = [0.001, 0.001, 0.015, 0.060, 0.060, 0.001]
    sd = [0.001, 0.005, 0.020, 0.020, np.nan, 0.004]
    assert one_site(gap, sd) == [1, -1, -1, 0, -1, 1]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("ffTTff", [("free", 2, 4, "free")]),
        ("TTff", [("trial", 0, 2, "free")]),
        ("ffTT", [("free", 2, 4, "trial")]),
        ("ffTTuu", [("free", 2, 4, "unknown")]),
        ("uuTTff", [("unknown", 2, 4, "free")]),
        ("ffTTuff", [("free", 2, 4, "unknown")]),
        ("fTuuTf", [("free", 1, 5, "free")]),
        ("fTfTf", [("free", 1, 2, "free"), ("free", 3, 4, "free")]),
        ("fTufuTf", [("free", 1, 2, "unknown"), ("unknown", 5, 6, "free")]),
        ("fuuf", []),
        ("", []),
    ],
)
def test_events(text: str, expected: list[tuple[str, float, float, str]]) -> None:
    assert events(text) == expected


def test_an_unknown_stretch_that_is_too_long_parts_a_contact() -> None:
    assert events("fTuuuTf", maximum_unknown=0.25) == [("free", 1, 2, "unknown"), ("unknown", 5, 6, "free")]


def test_contacts_and_breaks_shorter_than_the_least_duration_are_noise() -> None:
    assert events("fTf", minimum_contact=0.11) == []
    assert events("TTfTT", minimum_contact=0.11) == [("trial", 0, 5, "trial")]
    assert events("TTfTT", minimum_contact=0.10) == [("trial", 0, 2, "free"), ("free", 3, 5, "trial")]


@given(st.lists(st.sampled_from([TOUCHES, FREE, UNKNOWN]), min_size=1, max_size=200))
def test_what_holds_of_any_states(values: list[int]) -> None:
    column = np.array(values, dtype=np.int8)[:, None]
    parameters = replace(PARAMETERS, minimum_contact=0.01)
    found = contact_events(column, RATE, parameters)
    touched = set(np.flatnonzero(column[:, 0] == TOUCHES).tolist())
    covered = [frame for event in found for frame in range(event.first, event.last + 1)]
    assert len(covered) == len(set(covered))
    assert touched <= set(covered)
    for event in found:
        assert {event.first, event.last} <= touched
        for bound, frame in ((event.before, event.first - 1), (event.after, event.last + 1)):
            inside = 0 <= frame < len(values)
            assert (bound == "trial") == (not inside)
            assert not inside or (bound == "unknown") == (values[frame] == UNKNOWN)


def test_backwards_in_time_contacts_are_the_same_ones() -> None:
    text = "ffTTuTffuTTuuffTTf"
    forwards, backwards = events(text), events(text[::-1])
    n = len(text)
    assert backwards == [
        (after, n - last, n - first, before) for before, first, last, after in forwards[::-1]
    ]


def test_who_touches_first() -> None:
    def event(first: int, before: str = "free") -> ContactEvent:
        return ContactEvent(0, first, first + 5, before, "free")  # type: ignore[arg-type]

    assert ranks((event(1), event(2), event(2), event(4))) == [1, 2, 2, 4]
    assert ranks((event(1), event(2, "unknown"), event(3))) == [1, None, None]
    assert ranks((event(0, "trial"), event(3))) == [None, None]
    assert ranks(()) == []
