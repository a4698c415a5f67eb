"""``graspdb similar``: grasps like this one."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from graspdb.commands.options import DEFAULT_DB, Db, Json

if TYPE_CHECKING:
    from graspdb_queries.similar.answer import Similar
    from graspdb_queries.similar.placed import GraspsOn


class By(StrEnum):
    """What is compared."""

    FEATURE = "feature"
    POSTURE = "posture"
    CONTACT = "contact"
    ALL = "all"


class Mode(StrEnum):
    """How features are laid over each other."""

    SHAPE = "shape"
    HELD = "held"


class Posture(StrEnum):
    """How postures are compared."""

    SCALED = "scaled"
    METRIC = "metric"
    ANGLES = "angles"


class Units(StrEnum):
    """Units of lengths in a file."""

    MM = "mm"
    CM = "cm"
    DM = "dm"
    M = "m"


def similar(
    grasp: Annotated[
        str | None, typer.Argument(metavar="[GRASP]", help="Key of a grasp of the database.")
    ] = None,
    k: Annotated[int, typer.Option("-k", min=1, max=1000, help="How many to find.")] = 10,
    by: Annotated[By, typer.Option(help="What is compared.")] = By.FEATURE,
    mode: Annotated[
        Mode, typer.Option(help="Features in any pose (shape), or as they lie in the hand (held).")
    ] = Mode.SHAPE,
    posture: Annotated[
        Posture,
        typer.Option(help="Postures by joints of hands brought to one size, as they are, or by angles."),
    ] = Posture.SCALED,
    where: Annotated[
        str | None,
        typer.Option(metavar="SQL", help="Only grasps for which this is true: \"object <> 'mug'\"."),
    ] = None,
    cloud: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A part of an object, cloud or mesh, instead of a grasp."),
    ] = None,
    whole: Annotated[
        Path | None,
        typer.Option("--object", metavar="FILE", help="A whole new object: where would people grasp it?"),
    ] = None,
    units: Annotated[Units, typer.Option(help="Unit of the lengths in FILE.")] = Units.M,
    db: Db = DEFAULT_DB,
    as_json: Json = False,
) -> None:
    """Find grasps like one of the database, of parts like one from a file, or of a whole new object.

    Near grasps are found by the descriptors of their features (--by feature, contact or all) or by their
    postures; the hundred nearest are then aligned and compared closely. The cost of a hit is the sum of
    its parts, each a distance over the distance that costs one, times a weight; zero is the query itself.
    With --object grasps are laid onto the object of a file, and --json gives the hands in its frame.
    """
    _check(grasp, cloud, whole, (by, mode, posture))
    from graspdb.database import Database
    from graspdb_schemas.units import METRES_PER

    scale = METRES_PER[units.value]
    with Database(db) as database:
        found: Similar | GraspsOn
        if whole is not None:
            found = database.similar_on(whole, k, where=where, scale=scale)
        else:
            compared = {"by": by.value, "mode": mode.value, "posture": posture.value}
            found = database.similar(grasp, k, **compared, where=where, cloud=cloud, scale=scale)
    _show(found, as_json)


def _check(grasp: str | None, cloud: Path | None, whole: Path | None, compared: tuple[object, ...]) -> None:
    """Raise BadParameter unless one thing is asked about, in a respect in which it can be compared."""
    if sum(given is not None for given in (grasp, cloud, whole)) != 1:
        raise typer.BadParameter("give one of a GRASP, --cloud FILE and --object FILE", param_hint="GRASP")
    if whole is not None and compared != (By.FEATURE, Mode.SHAPE, Posture.SCALED):
        raise typer.BadParameter(
            "with --object grasps are compared by feature and shape", param_hint="--object"
        )


def _show(found: "Similar | GraspsOn", as_json: bool) -> None:
    """Print the hits, then what the search was; or all as JSON."""
    if as_json:
        import json

        typer.echo(json.dumps(found.as_json(), allow_nan=False))
        return
    from graspdb.output import write_rows

    write_rows(found.table().table.to_reader(), "table", None)
    if found.hits:
        typer.echo(f"best: {found.hits[0].explain()}")
    left = f", {found.left_out} could not be compared" if found.left_out else ""
    typer.echo(f"{found.searched} grasps searched{left}")
