"""A recording's labels become the markers of hands and an object, in the manifest's order."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graspdb_ingest.recording import Recording
from graspdb_ingest.trial_markers import select_markers
from graspdb_schemas.errors import MarkersNotFoundError, RecordingError
from graspdb_schemas.manifest import MarkerPlacement, Session, SessionObject, SessionTrial, Subject
from graspdb_schemas.vocabulary import Side

MARKERS = {"top": MarkerPlacement("hand"), "nail": MarkerPlacement("index_distal", at="index_tip")}


def session_of(sides: tuple[Side, ...] = (Side.RIGHT,), names: dict[str, str] | None = None) -> Session:
    box = SessionObject("box", Path("b.stl"), 1.0, {"m2": (0, 0, 0), "m1": (0.1, 0, 0), "m3": (0, 0.1, 0)})
    return Session(
        path=Path("session.yaml"),
        id="s",
        up=(0, 0, 1),
        file_scale=0.001,
        marker_set="custom",
        markers=MARKERS,
        marker_names=names or {},
        subjects={"p": Subject("p", sides, 0.19, 0.085, {})},
        objects={"box": box},
        trials=(),
        raw={},
    )


def trial_of(**keys: Any) -> SessionTrial:
    return SessionTrial("t", Path("t.c3d"), "t.c3d", "p", **keys)


def recording_of(labels: list[str], n_frames: int = 11, start: float = 0.0) -> Recording:
    """Return a recording in which every coordinate of a marker tells its column and frame."""
    columns = np.arange(1, len(labels) + 1)[None, :, None] + np.arange(n_frames)[:, None, None] / 100
    return Recording(Path("t.c3d"), tuple(labels), np.tile(columns, (1, 1, 3)), 10.0, start)


def column(values: Any) -> list[float]:
    return [float(value) for value in np.asarray(values)[0, :, 0]]


def test_markers_come_in_the_manifests_order_whatever_the_files_is() -> None:
    recording = recording_of(["m1", "extra", "nail", "m3", "top", "m2"])
    markers = select_markers(recording, session_of(), trial_of(object="box"))
    assert column(markers.hands[Side.RIGHT]) == [5, 3]
    assert markers.object_labels == ("m2", "m1", "m3")
    assert column(markers.object_markers) == [6, 1, 4]
    assert markers.found == ("top", "nail", "m2", "m1", "m3")
    assert (markers.not_found, markers.unused) == ((), ("extra",))


def test_any_order_of_columns_gives_the_same_markers() -> None:
    labels = ["m1", "nail", "top", "m2"]
    first = recording_of(labels)
    order = [2, 0, 3, 1]
    second = Recording(
        first.path, tuple(labels[i] for i in order), first.positions[:, order], first.rate, first.start_time
    )
    one, two = (select_markers(r, session_of(), trial_of(object="box")) for r in (first, second))
    np.testing.assert_array_equal(one.hands[Side.RIGHT], two.hands[Side.RIGHT])
    np.testing.assert_array_equal(one.object_markers, two.object_markers)


def test_what_the_file_lacks_is_missing_throughout() -> None:
    markers = select_markers(recording_of(["nail", "m1"]), session_of(), trial_of(object="box"))
    assert np.isnan(markers.hands[Side.RIGHT][:, 0]).all()
    assert np.isfinite(markers.hands[Side.RIGHT][:, 1]).all()
    assert markers.not_found == ("top", "m2", "m3")


def test_without_an_object_there_are_no_object_markers() -> None:
    markers = select_markers(recording_of(["nail", "m1"]), session_of(), trial_of())
    assert markers.object_markers.shape == (11, 0, 3)
    assert markers.unused == ("m1",)


def test_names_in_the_file_are_translated() -> None:
    session = session_of(names={"RIND": "nail", "Hand:BACK": "top"})
    for labels in (["RIND", "BACK"], ["RIND", "Hand:BACK"]):  # readers leave sets out where they can
        markers = select_markers(recording_of(labels), session, trial_of())
        assert column(markers.hands[Side.RIGHT]) == [2, 1]


def test_two_labels_for_one_marker_are_refused() -> None:
    session = session_of(names={"RIND": "nail"})
    with pytest.raises(RecordingError, match="'RIND' and 'nail' both stand for 'nail'"):
        select_markers(recording_of(["RIND", "nail"]), session, trial_of())


def test_both_hands_have_labels_with_their_side() -> None:
    session = session_of((Side.RIGHT, Side.LEFT), {"L1": "left_nail"})
    recording = recording_of(["L1", "right_top", "nail", "right_nail"])
    both = select_markers(recording, session, trial_of())
    assert np.isnan(both.hands[Side.LEFT][:, 0]).all()
    assert both.hands[Side.LEFT][0, 1, 0] == 1
    assert column(both.hands[Side.RIGHT]) == [2, 4]
    assert both.not_found == ("left_top",)
    assert both.unused == ("nail",)


def test_one_of_two_hands_may_have_labels_without_side() -> None:
    session = session_of((Side.RIGHT, Side.LEFT))
    markers = select_markers(recording_of(["nail", "top"]), session, trial_of(sides=(Side.LEFT,)))
    assert list(markers.hands) == [Side.LEFT]
    assert column(markers.hands[Side.LEFT]) == [2, 1]


def test_start_and_end_are_times_of_the_recording_and_both_included() -> None:
    recording = recording_of(["nail"], start=2.0)
    markers = select_markers(recording, session_of(), trial_of(start=2.3, end=2.7))
    np.testing.assert_allclose(markers.times, [2.3, 2.4, 2.5, 2.6, 2.7])
    np.testing.assert_allclose(markers.hands[Side.RIGHT][:, 1, 0], 1 + np.arange(3, 8) / 100)
    open_end = select_markers(recording, session_of(), trial_of(start=2.9))
    np.testing.assert_allclose(open_end.times, [2.9, 3.0])


def test_a_part_without_frames_is_refused() -> None:
    with pytest.raises(RecordingError, match="it covers 0 to 1 s"):
        select_markers(recording_of(["nail"]), session_of(), trial_of(start=5, end=6))


def test_a_file_with_none_of_the_markers_lists_what_it_has() -> None:
    with pytest.raises(MarkersNotFoundError) as caught:
        select_markers(recording_of(["P1", "P2"]), session_of(), trial_of(object="box"))
    assert caught.value.labels == ("P1", "P2")
    assert caught.value.wanted == ("top", "nail", "m2", "m1", "m3")
    assert "marker_names" in str(caught.value)


def test_a_marker_with_its_side_and_without_is_refused_where_one_hand_is_recorded() -> None:
    recording = recording_of(["nail", "right_nail", "top"])
    with pytest.raises(
        RecordingError, match="'nail' and 'right_nail' both stand for 'nail'"
    ):
        select_markers(recording, session_of(), trial_of())
    both = select_markers(recording, session_of((Side.RIGHT, Side.LEFT)), trial_of())
    assert both.unused == ("nail", "top")
