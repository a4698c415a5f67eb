"""Templates: texts are escaped, numbers are in the units that their headings name."""

import json

from hypothesis import given
from hypothesis import strategies as st

from graspdb.pages.templates import NONE, data_url, environment, in_unit, percent, script_json


@given(
    st.recursive(
        st.text() | st.integers() | st.none(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    )
)
def test_json_within_a_script_means_the_same_and_cannot_end_it(value: object) -> None:
    written = str(script_json(value))
    assert json.loads(written) == value
    assert not set("<>&\u2028\u2029") & set(written)


@given(st.text())
def test_every_text_is_escaped(text: str) -> None:
    written = environment().from_string("{{ text }}").render(text=text)
    assert not set("<>\"'") & set(written)


def test_units() -> None:
    assert in_unit(0.0123, "mm") == "12.3"
    assert in_unit(1.5e-4, "cm3", 0) == "150"
    assert percent(0.125) == "12.5 %"
    assert in_unit(None, "mm") == percent(None) == in_unit(float("nan"), "mm") == NONE


def test_a_file_within_an_address() -> None:
    assert data_url(b"\x00\xff", "image/webp") == "data:image/webp;base64,AP8="
