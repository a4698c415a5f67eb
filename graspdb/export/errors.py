"""What can go wrong with an export."""

from pathlib import Path

from graspdb_schemas.errors import GraspDBError


class ExportError(GraspDBError):
    """An export cannot be made, or not into this folder."""

    def __init__(self, path: Path, found: str, remedy: str) -> None:
        self.path = path
        self.found = found
        self.remedy = remedy
        super().__init__(f"{path}: {found}. {remedy}")
