"""A content key stands for content: all of it, and nothing but it."""

import pyarrow as pa
from handmade import session_tables
from hypothesis import given, settings
from hypothesis import strategies as st

from graspdb.store.content import content_key, units

VALUES = st.one_of(st.none(), st.lists(st.one_of(st.none(), st.floats(width=32)), max_size=3))
SCHEMA = pa.schema(
    [
        ("l", pa.list_(pa.float32())),
        ("s", pa.string()),
        ("b", pa.bool_()),
        ("i", pa.int16()),
        ("m", pa.map_(pa.string(), pa.float64())),
        ("t", pa.list_(pa.string())),
    ]
)
ROWS = st.lists(
    st.fixed_dictionaries(
        {
            "l": VALUES,
            "s": st.one_of(st.none(), st.text(max_size=3)),
            "b": st.one_of(st.none(), st.booleans()),
            "i": st.one_of(st.none(), st.integers(-5, 5)),
            "m": st.one_of(
                st.none(),
                st.dictionaries(st.text(max_size=2), st.floats(), max_size=2).map(lambda d: list(d.items())),
            ),
            "t": st.one_of(st.none(), st.lists(st.one_of(st.none(), st.text(max_size=2)), max_size=3)),
        }
    ),
    min_size=1,
    max_size=6,
)


def key(table: pa.Table) -> str:
    return content_key({"objects": table})


@settings(max_examples=60, deadline=None)
@given(ROWS, st.integers(0, 6))
def test_layout_in_memory_does_not_matter(rows: list[dict[str, object]], cut: int) -> None:
    table = pa.Table.from_pylist(rows, SCHEMA)
    cut = min(cut, len(rows))
    chunked = pa.concat_tables([table.slice(0, cut), table.slice(cut)])
    padded = pa.concat_tables([table, table]).slice(len(rows), len(rows))
    assert key(chunked) == key(padded) == key(table)


def test_keys_are_those_that_databases_have() -> None:
    rows = [
        {"l": [1.5, None], "s": "grüß", "b": True, "i": 3, "m": [("a", 0.5)], "t": ["x", None, ""]},
        {"l": None, "s": None, "b": None, "i": None, "m": None, "t": None},
        {"l": [], "s": "", "b": False, "i": -3, "m": [], "t": []},
    ]
    assert key(pa.Table.from_pylist(rows, SCHEMA)) == "24d56a56806aca237151ca6d48866b7e"


@settings(max_examples=60, deadline=None)
@given(ROWS, ROWS)
def test_different_rows_have_different_keys(
    first: list[dict[str, object]], second: list[dict[str, object]]
) -> None:
    # repr tells NaN from None and 0.0 from -0.0, as the key does.
    if repr(first) == repr(second):
        return
    one, other = (pa.Table.from_pylist(rows, SCHEMA) for rows in (first, second))
    assert (key(one) == key(other)) == (repr(one.to_pylist()) == repr(other.to_pylist()))


def test_each_description_is_a_unit_of_its_own() -> None:
    found = list(units(session_tables(subjects=["a", "b"], objects=["mug", "jug"]).tables))
    assert [unit.describes for unit in found] == [
        {"session": "s"},
        {"session": "s", "subject": "a"},
        {"session": "s", "subject": "b"},
        {"session": "s", "subject": "a", "side": "right"},
        {"session": "s", "subject": "b", "side": "right"},
        {"session": "s", "object": "mug"},
        {"session": "s", "object": "jug"},
    ]
    assert len({unit.content_key for unit in found}) == len(found)
    assert all(
        set(unit.tables["object_points"]["object"].to_pylist()) == {unit.describes["object"]}
        for unit in found[-2:]
    )
