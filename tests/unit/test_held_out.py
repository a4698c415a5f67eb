"""Gaps that markers are hidden in: seeded, apart, inside what was seen, and hidden from everything."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspdb.validation.markers import held_out_errors
from graspdb_ingest.held_out import Gap, draw_gaps, hidden_markers, share_out
from graspdb_schemas.errors import ParameterError

RATES = {"a": 100.0, "b": 50.0}


def seen(seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    shown = {name: np.ones((n, 4), dtype=bool) for name, n in (("a", 900), ("b", 300))}
    for part in shown.values():
        for marker in range(4):
            start = int(rng.integers(0, len(part) - 40))
            part[start : start + 40, marker] = False
    shown["a"][:, 3] = False
    return shown


@given(seed=st.integers(0, 50), seconds=st.sampled_from([0.05, 0.25, 1.0]))
def test_gaps_are_of_the_asked_length_inside_what_was_seen(seed, seconds):
    shown = seen(seed)
    gaps = draw_gaps(shown, RATES, seconds, 10, np.random.default_rng(seed))
    assert gaps
    for gap in gaps:
        assert gap.stop - gap.start == round(seconds * RATES[gap.trial])
        assert shown[gap.trial][gap.start - 1 : gap.stop + 1, gap.marker].all()
        assert gap.start >= 1
        assert gap.stop < len(shown[gap.trial])


def test_each_marker_has_as_many_gaps_as_asked_or_as_there_is_room():
    shown = seen()
    shown["b"][:, 3] = False
    shown["b"][10:30, 3] = True  # room for exactly one gap of 18 frames
    gaps = draw_gaps(shown, RATES, 0.36, 7, np.random.default_rng(0))
    assert [sum(gap.marker == m for gap in gaps) for m in range(4)] == [7, 7, 7, 1]


def test_the_seed_decides_the_gaps():
    first, again, other = (
        draw_gaps(seen(), RATES, 0.25, 5, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert first == again
    assert first != other


@given(seed=st.integers(0, 50))
def test_passes_hold_every_gap_once_and_keep_gaps_apart(seed):
    gaps = draw_gaps(seen(), RATES, 0.25, 6, np.random.default_rng(seed))
    passes = share_out(gaps, {"a": 100, "b": 50})
    assert sorted(map(repr, gaps)) == sorted(repr(gap) for part in passes for gap in part)
    for part in passes:
        for trial, apart in (("a", 100), ("b", 50)):
            here = sorted((gap for gap in part if gap.trial == trial), key=lambda gap: gap.start)
            assert all(later.start - earlier.stop >= apart for earlier, later in pairwise(here))


def test_far_gaps_share_one_pass():
    gaps = tuple(Gap("a", m, 250 * m + 1, 250 * m + 101) for m in range(4))
    assert share_out(gaps, {"a": 100}) == (gaps,)


def test_a_gap_hides_its_marker_alone():
    gaps = (Gap("a", 2, 5, 8), Gap("b", 0, 0, 3))
    hidden = hidden_markers(np.ones((10, 3), dtype=bool), gaps, "a")
    assert np.argwhere(hidden).tolist() == [[5, 2], [6, 2], [7, 2]]


@pytest.mark.parametrize("seconds", [0.0, -1.0, 61.0, float("nan")])
def test_a_length_that_is_none_is_refused(seconds, tmp_path):
    with pytest.raises(ParameterError, match="hold-out"):
        held_out_errors(tmp_path, seconds=seconds)
