"""Files of data gloves: units, times, names, and what is wrong with them."""

import numpy as np
import pytest

from graspdb_ingest.readers.glove import read_glove
from graspdb_schemas.errors import RecordingError
from graspdb_schemas.manifest import Glove

DEGREES = Glove(units="deg")


def write(tmp_path, text):
    file = tmp_path / "glove.csv"
    file.write_text(text, encoding="utf-8")
    return file


def test_angles_are_radians_whatever_the_titles_or_the_manifest_say(tmp_path):
    text = (
        "time,index_pip_flexion [deg],ring_pip_flexion (rad),thumb_ip_flexion\n0,90,1.5,45\n0.01,,1.25,30\n"
    )
    read = read_glove(write(tmp_path, text), DEGREES)
    assert read.sensors == ("index_pip_flexion", "ring_pip_flexion", "thumb_ip_flexion")
    expected = [[np.pi / 2, 1.5, np.pi / 4], [np.nan, 1.25, np.pi / 6]]
    assert np.allclose(read.angles, expected, equal_nan=True)
    assert np.allclose(read.times, [0, 0.01])
    assert read.own_clock


def test_decimal_commas_comments_frame_numbers_and_byte_order_marks_are_read(tmp_path):
    text = "\ufeff# glove 7\nframe;time (s);index_pip_flexion\n1;0,5;10,5\n2;0,51;11\n"
    read = read_glove(write(tmp_path, text), DEGREES)
    assert read.sensors == ("index_pip_flexion",)
    assert np.allclose(np.rad2deg(read.angles[:, 0]), [10.5, 11])
    assert np.allclose(read.times, [0.5, 0.51])


def test_a_file_without_times_needs_a_rate(tmp_path):
    file = write(tmp_path, "index_pip_flexion\n1\n2\n3\n")
    read = read_glove(file, Glove(units="deg", rate=50))
    assert np.allclose(read.times, [0, 0.02, 0.04])
    assert not read.own_clock
    with pytest.raises(RecordingError, match="no column of times"):
        read_glove(file, DEGREES)


def test_the_manifests_names_are_used_with_and_without_a_unit_behind_them(tmp_path):
    glove = Glove(units="deg", names={"T_IPJ": "thumb_ip_flexion", "I_PIJ [deg]": "index_pip_flexion"})
    file = write(tmp_path, "time,T_IPJ [deg],I_PIJ [deg]\n0,1,2\n0.01,1,2\n")
    assert read_glove(file, glove).sensors == ("thumb_ip_flexion", "index_pip_flexion")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no row of titles"),
        ("# nothing\n\n", "no row of titles"),
        ("time\n0\n1\n", "no column of angles"),
        ("time,a\n", "0 samples"),
        ("time,a\n0,1\n", "1 samples"),
        ("time,a\n0,x\n1,2\n", "line 2, column 'a': 'x' is not a number"),
        ("time,a\n0,1\n,2\n", "time column has blank cells"),
        ("time,a\n0,1\n0,2\n", "do not grow: 0 s is followed by 0 s"),
        ("time,a\n1,1\n0.5,2\n", "do not grow"),
        ("time,a,a\n0,1,2\n1,1,2\n", "2 columns stand for 'a'"),
        ("time,a,a [rad]\n0,1,2\n1,1,2\n", "2 columns stand for 'a'"),
        ("time,a\n0,\n1,\n", "no angle at all"),
        ("time,a\n0,400\n1,2\n", "400 deg stands in it"),
        ("time,a (rad)\n0,45\n1,2\n", "45 rad stands in it.*Is it in degrees"),
    ],
)
def test_a_file_that_is_no_gloves_says_what_it_is(tmp_path, text, complaint):
    file = write(tmp_path, text)
    with pytest.raises(RecordingError, match=complaint) as caught:
        read_glove(file, DEGREES)
    assert str(file) in str(caught.value)


def test_a_unit_that_nobody_states_is_asked_for(tmp_path):
    with pytest.raises(RecordingError, match=r"unit of column 'a' is not known.*units: deg"):
        read_glove(write(tmp_path, "time,a\n0,1\n1,2\n"), Glove())


def test_binary_and_missing_files_are_refused(tmp_path):
    file = tmp_path / "glove.csv"
    with pytest.raises(RecordingError, match="cannot be opened"):
        read_glove(file, DEGREES)
    file.write_bytes(bytes(range(256)))
    with pytest.raises(RecordingError, match="binary"):
        read_glove(file, DEGREES)
