"""Data sets of hands that are mostly MANO's: what was written in their layouts is read again."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from mano_sets import WRITERS, Truth, write_dexycb, write_hot3d_mano

from graspdb_ingest.importers.base import Clip, ClipSource, ImportOptions
from graspdb_ingest.importers.plausible import check_clip, side_found
from graspdb_ingest.importers.registry import IMPORTERS
from graspdb_schemas.vocabulary import Side


@dataclass(frozen=True)
class Written:
    """A data set on disk, what is in it, and its clips as they are read."""

    form: str
    root: Path
    truth: Truth
    options: ImportOptions
    sources: dict[str, ClipSource]

    def read(self, trial: str) -> Clip:
        """Read a clip by its name."""
        return IMPORTERS[self.form].read(self.sources[trial], self.options)


def write(form: str, root: Path, writer: Callable[[Path], Truth]) -> Written:
    truth = writer(root)
    options = ImportOptions(mano=truth.mano)
    sources = {source.name: source for source in IMPORTERS[form].find(root, options)}
    return Written(form, root, truth, options, sources)


@pytest.fixture(scope="module", params=[*WRITERS, "hot3d with MANO", "dexycb, right"])
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Written:
    name = request.param
    other = {
        "hot3d with MANO": ("hot3d", write_hot3d_mano),
        "dexycb, right": ("dexycb", lambda root: write_dexycb(root, side=Side.RIGHT)),
    }
    form, writer = other.get(name) or (name, WRITERS[name])
    return write(form, tmp_path_factory.mktemp("sets") / form, writer)


def test_hands_come_back_to_a_micrometre(written: Written) -> None:
    clip = written.read(written.truth.trial)
    assert {hand.side for hand in clip.hands} == set(written.truth.key_points)
    for hand in clip.hands:
        expected = written.truth.key_points[hand.side]
        np.testing.assert_allclose(hand.key_points, expected, rtol=0, atol=1e-6)


def test_object_poses_come_back(written: Written) -> None:
    clip = written.read(written.truth.trial)
    assert clip.poses is not None
    np.testing.assert_allclose(clip.poses, written.truth.poses, rtol=0, atol=1e-6)
    for trial, poses in written.truth.more.items():
        other = written.read(trial)
        assert other.poses is not None
        np.testing.assert_allclose(other.poses, poses, rtol=0, atol=1e-6)


def test_names_rate_and_vertical_come_back(written: Written) -> None:
    source, truth = written.sources[written.truth.trial], written.truth
    clip = written.read(truth.trial)
    assert source.object is not None
    assert source.object.file.is_file()
    assert source.subject.startswith(truth.subject)
    assert (source.object.name, clip.identifier, clip.task) == (truth.object, truth.identifier, truth.task)
    assert clip.rate == pytest.approx(truth.rate, rel=1e-6)
    assert clip.up == truth.up
    assert all(file.is_file() for file in source.files)


def test_what_is_read_passes_for_hands_of_that_side_and_size(written: Written) -> None:
    clip = written.read(written.truth.trial)
    check_clip(clip, written.root, None)
    sides = {hand.side: side_found(hand.key_points) for hand in clip.hands}
    assert all(found in (side, None) for side, found in sides.items())


def test_each_set_is_recognised_by_its_own_importer_alone(written: Written) -> None:
    alike = [name for name, entry in IMPORTERS.items() if entry.recognises(written.root)]
    assert alike == [written.form]


def test_subfolders_give_the_same_clips(written: Written) -> None:
    inner = {
        "dexycb": ("20200709-subject-01", "20200709-subject-01/20200709_141754"),
        "ho3d": ("train", "train/ABF10"),
        "grab": ("grab", "grab/s1"),
        "arctic": ("raw_seqs", "raw_seqs/s01"),
        "oakink": ("image",),
        "hot3d": ("P0003_c701bd11",),
    }[written.form]
    for folder in inner:
        found = {s.name: s for s in IMPORTERS[written.form].find(written.root / folder, written.options)}
        assert found.keys() == written.sources.keys()
        assert [s.files for s in found.values()] == [s.files for s in written.sources.values()]
        assert IMPORTERS[written.form].recognises(written.root / folder)


def test_measured_contact_of_hands_comes_back(tmp_path: Path) -> None:
    grab = write("grab", tmp_path / "grab", WRITERS["grab"])
    measured = grab.read(grab.truth.trial).measured
    assert measured is not None
    assert np.array_equal(measured.contact, np.asarray(grab.truth.contact))
    assert measured.positions.shape == (measured.contact.shape[1], 3)
