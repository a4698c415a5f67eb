"""The page of a report: one file, without scripts, that needs nothing from elsewhere."""

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Final

import numpy as np

from graspdb.database import Database
from graspdb.pages.templates import data_url, in_unit, render
from graspdb.report import charts
from graspdb.report.contents import GraspEntry, SessionReport, read_report
from graspdb.report.density import ObjectDensity
from graspdb.report.grasp_pages import grasp_pages
from graspdb.thumbnails import ShapeReader, draw, draw_shaded
from graspdb.validation.contacts import PAPER

_WEBP: Final = "image/webp"

_VIEWS: Final = (0.0, np.pi)
"""How far an object is turned in each of its pictures [rad]."""


@dataclass(frozen=True)
class Row:
    """The grasps of one subject in the grid of snapshots of an object."""

    subject: str | None
    grasps: tuple[GraspEntry, ...]


def write_report(
    database: Database, session: str, path: str | PathLike[str], *, pages: bool = False
) -> SessionReport:
    """Write the report on a session into one HTML file.

    Parameters
    ----------
    database : Database
        The database.
    session : str
        The session.
    path : path
        The file.
    pages : bool
        Whether to write a page of each grasp, too, and link it.

    Returns
    -------
    SessionReport
        What the report says.

    Raises
    ------
    QueryError
        There is no such session.
    OutputError
        The file cannot be written.
    """
    from graspdb.output import OutputError

    file = Path(path)
    report = read_report(database, session)
    with database.session(session) as part:
        keys = [grasp.grasp for grasp in report.grasps]
        pictures = {shape.grasp: draw(shape).webp() for shape in ShapeReader(part).shapes(keys)}
        links = grasp_pages(part, keys, file.with_name(f"{file.stem}_grasps")) if pages else {}
    page = report_page(report, pictures, links)
    try:
        file.write_text(page, encoding="utf-8")
    except OSError as error:
        raise OutputError(
            path, f"cannot be written: {error.strerror}", "Name another file with -o."
        ) from error
    return report


def report_page(report: SessionReport, pictures: Mapping[str, bytes], links: Mapping[str, str]) -> str:
    """Return the page of a report.

    Parameters
    ----------
    report : SessionReport
        What it says.
    pictures : mapping of str to bytes
        A WebP picture of each grasp, by its key.
    links : mapping of str to str
        Where the page of a grasp is, by its key; may be empty.
    """
    quality, session = report.quality, report.session
    pairs = dict.fromkeys(error.pair for error in report.table_1)
    return render(
        "report.html",
        report=report,
        grid=_grid(report),
        pictures={key: data_url(picture, _WEBP) for key, picture in pictures.items()},
        links=links,
        residuals=charts.residuals(quality, session),
        unused=charts.unused(quality, session),
        marker_residuals=charts.marker_residuals(quality),
        missing=charts.missing(quality),
        uncertainty=charts.uncertainty(quality),
        timelines=[(line, charts.timeline(line)) for line in report.timelines],
        densities=[(density, _density_pictures(density)) for density in report.densities],
        table_1=_table_1(report),
        pairs=sorted(pairs, key=lambda pair: [*PAPER, pair].index(pair)),
        paper=PAPER,
        explained=charts.explained(report.synergies) if report.synergies else None,
        synergy_plane=charts.synergy_plane(report.synergies, session) if report.synergies else None,
    )


def _grid(report: SessionReport) -> dict[str, list[Row]]:
    """Return the grasps by object and subject, in the order of repetitions: the paper's figure 3."""
    grid: dict[str, dict[str | None, list[GraspEntry]]] = {}
    for grasp in report.grasps:
        grid.setdefault(grasp.object or "", {}).setdefault(grasp.subject, []).append(grasp)
    return {
        name: [Row(subject, tuple(grasps)) for subject, grasps in rows.items()] for name, rows in grid.items()
    }


def _density_pictures(density: ObjectDensity) -> list[str]:
    known = np.isfinite(density.points).all(axis=1) & np.isfinite(density.normals).all(axis=1)
    shares = density.density / max(float(density.density.max()), np.finfo(float).tiny)
    points, normals = density.points[known], density.normals[known]
    return [data_url(draw_shaded(points, normals, shares[known], turn).webp(), _WEBP) for turn in _VIEWS]


def _table_1(report: SessionReport) -> dict[tuple[str, str], str]:
    """Return the mean errors of a pair's digits [mm], by subject and pair, as in the paper's Table I."""
    cells: dict[tuple[str, str], str] = {}
    known = {(error.subject, error.pair, error.digit): error.all_points.mean for error in report.table_1}
    for subject, pair, _ in known:
        means = [known.get((subject, pair, digit), np.nan) for digit in pair.split("+")]
        cells[subject, pair] = " / ".join(in_unit(mean, "mm") for mean in means)
    return cells
