"""Pickles of data sets: data come through whole, and anything else is refused before it runs."""

import builtins
import os
import pickle
import struct
import sys
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import (
    array_shapes,
    arrays,
    boolean_dtypes,
    complex_number_dtypes,
    floating_dtypes,
    integer_dtypes,
    unsigned_integer_dtypes,
)
from mano_file import python2_pickle
from scipy.sparse import csc_matrix, csr_matrix

from graspdb_ingest.importers import pickles
from graspdb_ingest.importers.pickles import MAX_TUPLES, unpickle
from graspdb_schemas.errors import ImportSourceError, UnsafeFileError

PATH = Path("meta/0001.pkl")
PROTOCOLS = range(pickle.HIGHEST_PROTOCOL + 1)

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: st.lists(inner, max_size=4) | st.tuples(inner, inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)

NUMBERS = st.one_of(
    boolean_dtypes(), integer_dtypes(), unsigned_integer_dtypes(), floating_dtypes(), complex_number_dtypes()
)


class Calls:
    """Pickles as a call of a function."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = function, arguments

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return self.call


@given(PLAIN, st.sampled_from(PROTOCOLS))
def test_plain_data_come_through(data: object, protocol: int) -> None:
    assert unpickle(pickle.dumps(data, protocol), PATH) == data


@given(arrays(NUMBERS, array_shapes(min_dims=0, min_side=0)), st.sampled_from(PROTOCOLS), st.booleans())
def test_arrays_come_through(array: np.ndarray, protocol: int, fortran: bool) -> None:
    array = np.asfortranarray(array) if fortran and array.ndim > 1 else array
    read = unpickle(pickle.dumps({"a": array}, protocol), PATH)
    assert isinstance(read, dict)
    assert read["a"].dtype == array.dtype
    np.testing.assert_array_equal(read["a"], array)
    assert read["a"].flags.writeable


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_scalars_texts_objects_and_ordered_dicts_come_through(protocol: int) -> None:
    data = {
        "scalar": np.float32(1.5),
        "bytes": np.array([b"ab", b"c"]),
        "text": np.array(["äb", "c"]),
        "objects": np.array([{"x": np.arange(3)}, None, "s"], dtype=object),
        "empty": np.zeros((0, 3)),
        "ordered": OrderedDict(a=1, b=[2]),
    }
    read = unpickle(pickle.dumps(data, protocol), PATH)
    assert isinstance(read, dict)
    assert read["scalar"] == np.float32(1.5)
    assert read["text"].tolist() == ["äb", "c"]
    assert read["bytes"].tolist() == [b"ab", b"c"]
    assert read["objects"][0]["x"].tolist() == [0, 1, 2]
    assert read["objects"][1:].tolist() == [None, "s"]
    assert read["empty"].shape == (0, 3)
    assert read["ordered"] == {"a": 1, "b": [2]}


def test_pickles_of_python_2_come_through() -> None:
    data = {
        "pose": np.arange(6.0).reshape(2, 3),
        "name": "021_bleach",
        "few": {1},
        "none": None,
        "i": np.int64(3),
    }
    written = python2_pickle(data)
    assert b"numpy.core.multiarray" in written
    assert b"_codecs" not in written
    read = unpickle(written, PATH)
    assert isinstance(read, dict)
    assert read["pose"].tolist() == [[0, 1, 2], [3, 4, 5]]
    assert (read["name"], read["few"], read["none"], read["i"]) == ("021_bleach", [1], None, 3)


@pytest.mark.parametrize("kind", [csc_matrix, csr_matrix])
def test_sparse_matrices_become_dense(kind: type) -> None:
    dense = np.array([[0, 1.5, 0], [2.5, 0, 0]])
    assert np.array_equal(np.asarray(unpickle(pickle.dumps(kind(dense)), PATH)), dense)
    empty = np.asarray(unpickle(pickle.dumps(kind((4, 0))), PATH))
    assert empty.shape == (4, 0)


def test_what_is_shared_is_read_once() -> None:
    deep: object = np.arange(3)
    for _ in range(30):
        deep = [deep, deep]
    read = unpickle(pickle.dumps(deep), PATH)
    assert isinstance(read, list)
    assert read[0] is read[1]


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize(
    "call",
    [
        Calls(os.system, "touch harm"),
        Calls(builtins.eval, "open('harm', 'w')"),
        Calls(builtins.getattr, os, "system"),
        Calls(np.load, "harm", None, True),
        Calls(np.fromfile, "harm"),
        Calls(np.zeros, (10**12,)),
        Calls(np.memmap, "harm"),
        Calls(np.f2py.run_main, ["harm"]),
        Calls(np.testing.rundocs, "harm"),
        Calls(bytearray, 10**12),
        Calls(pickle.loads, b"N."),
        Calls(sys.exit),
    ],
    ids=lambda call: call.call[0].__name__,
)
def test_calls_are_refused_and_not_made(
    call: Calls, protocol: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        written = pickle.dumps({"pose": [np.zeros(3), call]}, protocol)
    except TypeError:
        written = pickle.dumps({"pose": [np.zeros(3), Calls(call.call[0])]}, protocol)
    with pytest.raises(UnsafeFileError, match=r"meta/0001.pkl: its pickle holds the name .*not data"):
        unpickle(written, PATH)
    assert not list(tmp_path.iterdir())


def _text(text: str) -> bytes:
    return b"\x8c" + bytes([len(text)]) + text.encode()


def _ask(module: str, name: str) -> bytes:
    return f"c{module}\n{name}\n".encode()


REBUILD = _ask("numpy.core.multiarray", "_reconstruct") + _ask("numpy", "ndarray") + b"K\x00\x85U\x01b\x87R"
F8 = _ask("numpy", "dtype") + b"U\x02f8K\x00K\x01\x87R"


@pytest.mark.parametrize(
    ("written", "found"),
    [
        (b"Vsomewhere\nQ.", "the instruction BINPERSID"),
        (b"(lPhere\na.", "the instruction PERSID"),
        (b"\x82\x01.", "the instruction EXT1"),
        (b"(ios\nsystem\n.", "the instruction INST"),
        (b"(cos\nsystem\nVls\no.", "the instruction OBJ"),
        (_ask("os", "system"), "the name os.system"),
        (b"\x80\x04" + _text("os") + _text("system") + b"\x93.", "the name os.system"),
        (_ask("numpy", "dtype") + b".", "a name instead of data"),
        (_ask("numpy", "ndarray") + b"K\x05\x85R.", "a call of numpy.ndarray"),
        (_ask("numpy", "dtype") + b"}b.", "a change to numpy.dtype"),
        (_ask("numpy", "dtype") + b"U\x04V999\x85R.", "numpy data type 'V999'"),
        (_ask("numpy", "dtype") + b"U\x05i4,f8\x85R.", "numpy data type"),
        (_ask("numpy", "dtype") + b")R.", "numpy.dtype with arguments that are not its own"),
        (
            _ask("numpy.core.multiarray", "_reconstruct") + _ask("os", "system") + b"K\x00\x85U\x01b\x87R.",
            "os.system",
        ),
        (REBUILD + b".", "an array without data"),
        (REBUILD + b"(K\x01J\xff\xff\xff\x7f\x85" + F8 + b"I00\nU\x08AAAAAAAAtb.", "does not fit its data"),
        (REBUILD + b"(K\x01J\xff\xff\xff\xff\x85" + F8 + b"I00\nU\x08AAAAAAAAtb.", "not a few lengths"),
        (REBUILD + b"}b.", "a state that is not its own"),
        (_ask("chumpy.ch", "Ch") + b")\x81.", "Ch without x"),
        (_ask("chumpy.ch", "Ch") + b")\x81K\x01b.", "not its attributes"),
        (_ask("chumpy.ch_ops", "add") + b")\x81.", "the name chumpy.ch_ops.add"),
        (b"]q\x00h\x00a.", "an object that holds itself"),
        (b"}(K\x01K\x02\x86K\x03u.", "keys are neither text nor numbers"),
        (b"]r\xff\xff\xff\x7f.", "a memory place of number 2147483647"),
        (b"]" * 100 + b"a" * 99 + b".", "deep in each other"),
        (b"N" + b"\x85" * (MAX_TUPLES + 1) + b".", f"more than {MAX_TUPLES} tuples"),
    ],
)
def test_tricks_are_refused(written: bytes, found: str) -> None:
    with pytest.raises(UnsafeFileError, match=found):
        unpickle(written if written.endswith(b".") else written + b".", PATH)


def test_too_many_instructions_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pickles, "MAX_INSTRUCTIONS", 1000)
    assert unpickle(b"N0" * 499 + b"N.", PATH) is None
    with pytest.raises(UnsafeFileError, match="more than 1000 instructions"):
        unpickle(b"N0" * 500 + b"N.", PATH)


@pytest.mark.parametrize("kind", [csc_matrix, csr_matrix])
def test_a_sparse_matrix_is_not_written_out_beyond_bounds(kind: type) -> None:
    with pytest.raises(UnsafeFileError, match="a sparse matrix of shape"):
        unpickle(pickle.dumps(csc_matrix((10**6, 10**6))), PATH)
    for part, place, value in (
        ("indices", 0, 10**6),
        ("indices", 0, -1),
        ("indptr", 3, -(1 << 30)),
        ("indptr", 1, 1 << 30),
        ("indptr", 0, 1),
    ):
        broken = kind(np.eye(3))
        getattr(broken, part)[place] = value
        with pytest.raises(UnsafeFileError, match="a sparse matrix w"):
            unpickle(pickle.dumps(broken), PATH)


@given(st.binary(max_size=60))
def test_noise_is_refused_or_plain(noise: bytes) -> None:
    try:
        unpickle(noise, PATH)
    except ImportSourceError as error:
        assert "meta/0001.pkl" in str(error)  # noqa: PT017


@given(st.data())
def test_a_pickle_with_a_changed_byte_is_refused_or_data(data: st.DataObject) -> None:
    protocol = data.draw(st.sampled_from(PROTOCOLS))
    written = bytearray(pickle.dumps({"pose": np.arange(4.0), "name": "mug", "n": 3}, protocol))
    place = data.draw(st.integers(0, len(written) - 1))
    written[place] = data.draw(st.integers(0, 255))
    try:
        unpickle(bytes(written), PATH)
    except ImportSourceError as error:
        assert "meta/0001.pkl" in str(error)  # noqa: PT017


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_half_a_pickle_is_named_as_such(protocol: int) -> None:
    written = pickle.dumps({"pose": np.arange(100.0)}, protocol)
    for size in (0, 1, len(written) // 2, len(written) - 1):
        with pytest.raises(ImportSourceError, match="no whole pickle") as caught:
            unpickle(written[:size], PATH)
        assert not isinstance(caught.value, UnsafeFileError)


def test_a_length_beyond_the_file_reserves_nothing() -> None:
    for instruction, length in ((b"\x8e", struct.pack("<Q", 1 << 40)), (b"B", struct.pack("<I", 1 << 31))):
        with pytest.raises(ImportSourceError, match="no whole pickle"):
            unpickle(b"\x80\x04" + instruction + length + b"abc.", PATH)
