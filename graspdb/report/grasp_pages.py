"""Pages of single grasps, beside the report that links them."""

import re
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from graspdb.database import Database


def grasp_pages(database: Database, grasps: Sequence[str], folder: Path) -> dict[str, str]:
    """Write a page of each grasp into a folder and return where it is, from the folder's parent, by key."""
    raise NotImplementedError
