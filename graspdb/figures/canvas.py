"""What figures are drawn on: matplotlib, without a display and without its global state."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from graspdb.view import palette
from graspdb.view.write import write_bytes
from graspdb_schemas.errors import MissingLibraryError, ParameterError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMS: Final = (".png", ".svg", ".pdf")
"""Endings of the files that can be written."""

COLUMN, PAGE = 85.0, 178.0
"""Widths of one column and of a page's text in most journals [mm]."""

DOTS: Final = 300
"""Dots per inch of what is no line."""

_INCH: Final = 25.4

_STYLE: Final[dict[str, Any]] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 7,
    "axes.titlesize": 7.5,
    "axes.labelsize": 7,
    "axes.linewidth": 0.6,
    "axes.edgecolor": palette.INK,
    "axes.labelcolor": palette.INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.color": palette.INK,
    "xtick.color": palette.INK,
    "ytick.color": palette.INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 6.5,
    "lines.linewidth": 1.2,
    # Names are shown as they are: a dollar sign in one begins no formula.
    "text.parse_math": False,
    # Text stays text, for whoever sets the paper; the same figure gives the same file.
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
    "svg.hashsalt": "graspdb",
}


@contextmanager
def canvas(path: Path, width: float, height: float) -> Iterator["Figure"]:
    """Give an empty figure to draw on, and write it whole or not at all when that is done.

    Parameters
    ----------
    path : Path
        The file; its ending says the form.
    width, height : float
        Size [mm].

    Raises
    ------
    ParameterError
        The ending is none of `FORMS`.
    MissingLibraryError
        matplotlib is not installed.
    OutputError
        The file cannot be written.
    """
    check_form(path)
    try:
        import matplotlib as mpl
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingLibraryError(
            "matplotlib", str(error), "Install it: pip install 'graspdb[figures]'"
        ) from error
    style: Any = {**mpl.rcParamsDefault, **_STYLE, "backend": "agg"}
    with mpl.rc_context(style):
        figure = Figure(figsize=(width / _INCH, height / _INCH), layout="constrained", dpi=DOTS)
        yield figure
        form = path.suffix[1:].lower()
        content = io.BytesIO()
        undated: dict[str, Any] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}[form]
        figure.savefig(content, format=form, metadata=undated)
    write_bytes(path, content.getvalue())


def check_form(path: Path) -> None:
    """Raise ParameterError unless a figure can be written to such a file."""
    if path.suffix.lower() not in FORMS:
        raise ParameterError("figure file", path.name, f"a name that ends in {', '.join(FORMS)}")


def pixels(millimetres: float) -> int:
    """Return how many pixels a length on paper takes."""
    return round(millimetres / _INCH * DOTS)


def bare(axes: "Axes") -> None:
    """Take the frame and ticks away from axes, for a picture."""
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)
