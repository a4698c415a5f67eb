"""Run docs/tutorial.ipynb on a database and keep what it shows: tools/run_tutorial.py DATABASE."""

import os
import sys
from pathlib import Path
from typing import Any, Final

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOK: Final = ROOT / "docs" / "tutorial.ipynb"

# Its functions have no types.
_read: Any = nbformat.read
_write: Any = nbformat.write


def run(database: Path, folder: Path) -> Any:
    """Return the tutorial as it comes out on a database.

    Parameters
    ----------
    database : Path
        A database of the simulated objects, as `graspdb demo` makes it.
    folder : Path
        Where it runs, and where its files go.

    Returns
    -------
    nbformat.NotebookNode
        The notebook with its outputs.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        A cell failed.
    """
    notebook = _read(NOTEBOOK, as_version=4)
    client = NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}})
    client.execute(env={**os.environ, "GRASPDB": str(database.resolve())})
    for cell in notebook.cells:
        # When each cell ran says nothing about it, and changes every time.
        cell.metadata.pop("execution", None)
    # The interpreter's version is no matter of the notebook's.
    notebook.metadata.pop("language_info", None)
    return notebook


def main() -> None:
    """Run it and write it back, outputs included."""
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        notebook = run(Path(sys.argv[1]), Path(folder))
    _write(notebook, NOTEBOOK)


if __name__ == "__main__":
    main()
