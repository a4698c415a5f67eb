"""Pages of single grasps, beside the report that links them."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final
from urllib.parse import quote

from graspdb.database import Database
from graspdb.view.page import grasp_page
from graspdb.view.reading import SceneReader
from graspdb_schemas.errors import QueryError

_UNSAFE: Final = re.compile(r"[^A-Za-z0-9_.-]+")
"""What no file's name should have in it."""

_LONGEST: Final = 100
"""Characters of a key in a file's name."""


def grasp_pages(database: Database, grasps: Sequence[str], folder: Path) -> dict[str, str]:
    """Write the viewer's page of each grasp into a folder.

    Parameters
    ----------
    database : Database
        The database.
    grasps : sequence of str
        Keys.
    folder : Path
        The folder, made where there is none.

    Returns
    -------
    dict of str to str
        Address of each grasp's page, from the folder that `folder` is in; one that cannot be shown has none.
    """
    folder.mkdir(parents=True, exist_ok=True)
    reader = SceneReader(database)
    links = {}
    for number, key in enumerate(grasps):
        name = f"{number:04}_{_UNSAFE.sub('_', key)[-_LONGEST:]}.html"
        try:
            page = grasp_page(reader.scene(key))
        except QueryError:
            # A hand of which too little is stored has its picture alone.
            continue
        (folder / name).write_text(page, encoding="utf-8")
        links[key] = quote(f"{folder.name}/{name}")
    return links
