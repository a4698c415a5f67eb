"""Episodes as trainers want them: what is kept, what is filled, what follows what."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_trials import RATE, turning

from graspdb.export.items import Episode
from graspdb.export.options import ExportOptions
from graspdb.export.steps import NO_ANGLES, NOT_KNOWN, STATIC, Steps, longest_run, steps_of

N = 40
AS_RECORDED = ExportOptions(fps=int(RATE))


def episode(n: int = N) -> Episode:
    rng = np.random.default_rng(n)
    q = rng.normal(size=(n, 30))
    q[:, 3:7] = turning(n, RATE, 0, 1.0)
    return Episode(
        **dict.fromkeys(("trial", "side", "session", "subject", "object", "task", "split"), "x"),
        grasps=("x",),
        rate=RATE,
        time=np.arange(n) / RATE,
        q=q,
        sites=rng.normal(size=(n, 20, 3)),
        object_position=rng.normal(size=(n, 3)),
        object_quaternion=turning(n, RATE, 1, 2.0),
        touching=(rng.uniform(size=(n, 20)) < 0.5).astype(float),
    )


def lost(**places: slice) -> Episode:
    """Return an episode in which values of some arrays are not known."""
    known = episode()
    arrays = {name: getattr(known, name).copy() for name in places}
    for name, place in places.items():
        arrays[name][place] = np.nan
    return replace(known, **arrays)


def stepped(one: Episode, options: ExportOptions) -> Steps:
    steps = steps_of(one, options)
    assert isinstance(steps, Steps)
    return steps


def test_steps_are_the_frames_in_float32() -> None:
    one = episode()
    steps = stepped(one, AS_RECORDED)
    np.testing.assert_array_equal(steps.state, one.q.astype(np.float32))
    pose = np.hstack([one.object_position, one.object_quaternion])
    np.testing.assert_array_equal(steps.environment[:, :7], pose.astype(np.float32))
    np.testing.assert_array_equal(steps.environment[:, 7:], one.touching)
    assert steps.known.all()
    assert steps.dropped == 0
    by_site = stepped(one, replace(AS_RECORDED, state="sites"))
    np.testing.assert_array_equal(by_site.state, one.sites.reshape(N, 60).astype(np.float32))


@pytest.mark.parametrize("fps", [7, 30, 100, 120])
def test_an_action_is_the_next_state(fps: int) -> None:
    steps = stepped(episode(), ExportOptions(fps=fps))
    np.testing.assert_array_equal(steps.action[:-1], steps.state[1:])
    np.testing.assert_array_equal(steps.action[-1], steps.state[-1])


def test_dropping_keeps_the_longest_run_in_which_all_is_known() -> None:
    one = lost(q=slice(3, 5), object_position=slice(20, 21), touching=slice(38, 39))
    steps = stepped(one, AS_RECORDED)
    np.testing.assert_array_equal(steps.state, one.q[21:38].astype(np.float32))
    assert steps.start == pytest.approx(0.21)
    assert steps.dropped == N - len(steps)


def test_masking_holds_what_was_known_last_and_says_so() -> None:
    one = lost(q=slice(0, 5), object_position=slice(20, 25), touching=slice(38, 40))
    steps = stepped(one, replace(AS_RECORDED, missing="mask"))
    assert len(steps) == N
    assert np.isfinite(steps.state).all()
    assert np.isfinite(steps.environment).all()
    np.testing.assert_array_equal(steps.state[:5], np.tile(one.q[5].astype(np.float32), (5, 1)))
    np.testing.assert_array_equal(steps.environment[20:25, :3], np.tile(steps.environment[19, :3], (5, 1)))
    np.testing.assert_array_equal(np.flatnonzero(~steps.known[:, 0]), np.arange(5))
    np.testing.assert_array_equal(np.flatnonzero(~steps.known[:, 1]), np.arange(20, 25))
    np.testing.assert_array_equal(np.flatnonzero(~steps.known[:, 2]), [38, 39])
    assert set(steps.columns("mask")) - set(steps.columns("drop")) == {
        "hand_known",
        "object_known",
        "contact_known",
    }


@pytest.mark.parametrize("missing", ["drop", "mask"])
def test_what_has_no_steps(missing: str) -> None:
    options = replace(AS_RECORDED, missing=missing)
    assert steps_of(episode(1), options) is STATIC
    assert steps_of(replace(episode(), rate=float("nan")), options) is STATIC
    assert steps_of(lost(q=slice(None)), options) is NO_ANGLES
    assert steps_of(lost(object_position=slice(None)), options) is NOT_KNOWN
    assert isinstance(steps_of(lost(q=slice(None)), replace(options, state="sites")), Steps)


@given(st.lists(st.booleans(), max_size=30))
def test_the_longest_run_is_found(truths: list[bool]) -> None:
    start, end = longest_run(np.array(truths, dtype=bool))
    runs = [(i, j) for i in range(len(truths)) for j in range(i + 1, len(truths) + 1) if all(truths[i:j])]
    assert (start, end) == max(runs, key=lambda run: (run[1] - run[0], -run[0]), default=(0, 0))
