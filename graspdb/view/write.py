"""Pages written to files."""

from pathlib import Path

from graspdb.database import Database
from graspdb.output import OutputError
from graspdb.view.likeness import likeness_of
from graspdb.view.page import grasp_page, likeness_page
from graspdb.view.reading import SceneReader


def write_page(database: Database, path: Path, grasp: str, other: str | None = None) -> Path:
    """Write the page of one grasp, or of two beside each other, and return its path.

    Raises
    ------
    QueryError
        There is no such grasp, or the radii of its hand are not stored.
    ParameterError
        The two grasps are one.
    OutputError
        The file cannot be written.
    """
    reader = SceneReader(database)
    if other is None:
        text = grasp_page(reader.scene(grasp))
    else:
        likeness = likeness_of(database, grasp, other)
        text = likeness_page(reader.scene(grasp), reader.scene(other), likeness)
    return write_text(path, text)


def write_text(path: Path, text: str) -> Path:
    """Write a file whole or not at all.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    return write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a file whole or not at all.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_bytes(content)
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise OutputError(
            path, f"cannot be written: {error.strerror}", "Name another file with -o."
        ) from error
    return path
