"""``graspdb validate contact-map``: a contact map against contact measured on the object."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from graspdb.validation.contact_map import MapValidation
    from graspdb_ingest.surface import HandPoints


def contact_map(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Measured contact: NPZ, CSV or PLY.")],
    grasp: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY", help="A grasp of the database that held the object; may be repeated."),
    ] = None,
    surface: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="spheres, capsules or skin; may be repeated. All unless given."),
    ] = None,
    contact_above: Annotated[
        float, typer.Option(min=0, max=1, help="Measured contact above this counts as touched.")
    ] = 0.4,
    gap: Annotated[
        list[float] | None,
        typer.Option(metavar="MM", help="Gap at which to compare [mm]; repeatable. 0, 2, 4 unless given."),
    ] = None,
    db: Db = DEFAULT_DB,
    as_json: Json = False,
) -> None:
    """Compare a grasp's contact map with contact measured on the object, as by a thermal camera.

    FILE holds points of the object's surface in metres, in the object's frame, with the measured contact
    from 0 to 1. NPZ: positions (n, 3) and contact (n,), if known normals (n, 3) or faces (m, 3), and the
    hands as key_points (k, 21, 3) with sides (k,) right or left and, if measured, radii (k, 20).
    CSV: columns x, y, z, contact and, if known, nx, ny, nz. PLY: vertices with a property contact.
    Hands that the file does not have come from the database: name their grasps with --grasp.

    Precision, recall and F1 are those of calling a point touched if its gap is at most a threshold; the
    area under the curve (AUC) is over all thresholds. The pressing gap grows where the object's surface
    faces away from the hand.
    """
    from graspdb.validation.contact_map import validate_map
    from graspdb.validation.contact_map_file import read_measured_map
    from graspdb_ingest.surface import SURFACES

    measured, hands = read_measured_map(file)
    if grasp:
        hands = _hands(db, grasp)
    if not hands:
        missing = f"{file} has no key points: name the grasps that held the object"
        raise typer.BadParameter(missing, param_hint="--grasp")
    thresholds = [value / 1000 for value in gap or (0.0, 2.0, 4.0)]
    found = validate_map(measured, hands, surface or SURFACES, contact_above, thresholds)
    if as_json:
        typer.echo(json.dumps([asdict(row) for row in found], indent=2))
    else:
        _print(found)


def _hands(db: str, grasps: "Sequence[str]") -> "tuple[HandPoints, ...]":
    from graspdb.database import Database
    from graspdb.validation.grasp_hand import hand_of_grasp

    with Database(db) as database:
        return tuple(hand_of_grasp(database, key) for key in grasps)


def _print(found: "Sequence[MapValidation]") -> None:
    from rich.console import Console
    from rich.table import Table

    at = [f"{1000 * one.threshold:g} mm" for one in found[0].at]
    table = Table("surface", "gap", "AUC", "best F1", "at", *at, box=None, pad_edge=False)
    for column in table.columns:
        column.no_wrap = True
    for row in found:
        cells = [f"{one.precision:.2f} {one.recall:.2f} {one.f1:.2f}" for one in row.at]
        best = (f"{row.auc:.3f}", f"{row.best.f1:.3f}", f"{1000 * row.best.threshold:.1f} mm")
        table.add_row(row.surface, row.gap, *best, *cells)
    console = Console()
    console.print(table)
    console.print("\nUnder each threshold: precision, recall, F1", highlight=False)
