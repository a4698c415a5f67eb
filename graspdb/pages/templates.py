"""The templates of all pages: one environment, in which every text is escaped unless a template made it."""

import base64
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from graspdb.view.palette import CATEGORIES, DIGIT_COLOURS, SCALE

if TYPE_CHECKING:
    from jinja2 import Environment

_FROM_METRES: Final = {"mm": 1e3, "cm": 1e2, "cm3": 1e6}
"""Factors from SI units to those that are read easily."""

NONE: Final = "-"
"""What stands where there is no value."""


def render(template: str, **values: Any) -> str:
    """Return a page.

    Parameters
    ----------
    template : str
        File in ``graspdb/pages/templates``.
    **values
        What the template shows; texts are escaped.
    """
    return environment().get_template(template).render(**values)


@cache
def environment() -> "Environment":
    """Return the environment of all templates."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader("graspdb.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"si": in_unit, "or_none": or_none}
    made.globals |= {"categories": CATEGORIES, "digit_colours": DIGIT_COLOURS, "scale": SCALE}
    return made


def in_unit(value: float | None, unit: str, decimals: int = 1) -> str:
    """Return a length [m] or volume [m3] as a number of mm, cm or cm3."""
    return NONE if value is None or value != value else f"{value * _FROM_METRES[unit]:.{decimals}f}"


def or_none(value: object) -> object:
    """Return a value, or what stands where there is none."""
    return NONE if value is None or value == "" else value


def data_url(content: bytes, kind: str) -> str:
    """Return a file as an address that carries it."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
