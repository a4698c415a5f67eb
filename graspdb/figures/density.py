"""Where an object is touched, as colours on it."""

from pathlib import Path
from typing import Final

import numpy as np

from graspdb.database import Database
from graspdb.figures.canvas import PAGE, bare, canvas, pixels
from graspdb.view import palette
from graspdb.view.camera import Camera, cameras_around
from graspdb.view.picture import surface_picture
from graspdb.view.reading import SceneReader
from graspdb.view.scene import Floats, Scene
from graspdb_schemas.errors import QueryError

_SHARE: Final = "touched"
_VIEWS: Final = 4

_CLOUD: Final = """
    SELECT cloud, any_value(grasp) AS grasp, count(*) AS n
    FROM grasp_objects
    WHERE object = $object
    GROUP BY cloud
    ORDER BY n DESC, cloud
    LIMIT 1
"""


def contact_density_figure(database: Database, path: Path, name: str) -> None:
    """Draw an object from all sides, coloured by the share of its grasps that touch within 10 mm of a point.

    The numbers are those of the query where_grasped. Where several objects have the name, the one with most
    grasps is drawn.

    Raises
    ------
    QueryError
        There is no grasp of such an object.
    ParameterError, MissingLibraryError, OutputError
        See `graspdb.figures.canvas.canvas`.
    """
    found = database.sql(_CLOUD, object=name).rows()
    if not found:
        raise QueryError(
            f"the database has no grasp of an object {name!r}",
            "graspdb sql 'SELECT DISTINCT object FROM grasps' lists them.",
        )
    cloud, key, count = found[0]
    side = PAGE / _VIEWS
    with canvas(path, PAGE, side + 16) as figure:
        scene = SceneReader(database).scene(key, motion=False)
        shares = _shares(database, name, cloud, len(scene.surface.points))
        most = max(float(shares.max()), 1e-9)
        colours = palette.scale_colours(shares / most)
        axes = figure.subplots(1, _VIEWS)
        for one, camera in zip(axes, _turned(scene), strict=True):
            bare(one)
            one.imshow(surface_picture(scene, colours, camera, pixels(side), pixels(side)))
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import LinearSegmentedColormap, Normalize

        scale = LinearSegmentedColormap.from_list("viridis", list(palette.SCALE))
        bar = figure.colorbar(
            ScalarMappable(Normalize(0, 100 * most), scale),
            ax=axes,
            orientation="horizontal",
            fraction=0.05,
            aspect=60,
        )
        bar.set_label(f"share of {count} grasps that touch within 10 mm [%]")
        figure.suptitle(name)


def _shares(database: Database, name: str, cloud: str, points: int) -> Floats:
    rows = database.query("where_grasped", object=name).table
    shares = np.zeros(points)
    for at, point, share in zip(
        *(rows[column].to_pylist() for column in ("cloud", "point", _SHARE)), strict=True
    ):
        if at == cloud and share is not None:
            shares[point] = share
    return shares


def _turned(scene: Scene) -> list[Camera]:
    """Return cameras from four sides, half way up."""
    cameras = cameras_around(scene, object_alone=True)
    level = len(cameras) // 3
    ring = cameras[level : 2 * level]
    return [ring[round(k * level / _VIEWS)] for k in range(_VIEWS)]
