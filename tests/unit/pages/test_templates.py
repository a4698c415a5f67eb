"""Templates: texts are escaped, numbers are in the units that their headings name."""

from hypothesis import given
from hypothesis import strategies as st

from graspdb.pages.templates import NONE, data_url, environment, in_unit


@given(st.text())
def test_every_text_is_escaped(text: str) -> None:
    written = environment().from_string("{{ text }}").render(text=text)
    assert not set("<>\"'") & set(written)


def test_units() -> None:
    assert in_unit(0.0123, "mm") == "12.3"
    assert in_unit(1.5e-4, "cm3", 0) == "150"
    assert in_unit(None, "mm") == in_unit(float("nan"), "mm") == NONE


def test_a_file_within_an_address() -> None:
    assert data_url(b"\x00\xff", "image/webp") == "data:image/webp;base64,AP8="
