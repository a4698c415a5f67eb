"""Importing data sets of MANO hands: how long a thousand frames take, reading alone and in all."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

from harness import Result, benchmark
from threadpoolctl import threadpool_limits

from graspdb.importing import import_data_set
from graspdb_ingest.importers.base import ImportOptions
from graspdb_ingest.importers.registry import IMPORTERS

sys.path.append(str(Path(__file__).parents[1]))
from mano_sets import WRITERS, Truth

N_FRAMES = 1000


@benchmark("import of MANO data sets")
def import_mano() -> list[Result]:
    """Read, then import, 1,000 frames of each, made up in its layout; processor time of one process."""
    results = []
    for form in WRITERS:
        with _written(form) as (root, truth), threadpool_limits(1):
            options = ImportOptions(mano=truth.mano)
            start = process_time()
            sources = list(IMPORTERS[form].find(root, options))
            source = next(source for source in sources if source.name == truth.trial)
            IMPORTERS[form].read(source, options)
            reading = process_time() - start
            start = process_time()
            import_data_set(form, root, root / "grasps", options=options)
            whole = (process_time() - start) / len(sources)
        hands = f"{len(truth.key_points)} hand{'s' if len(truth.key_points) > 1 else ''}"
        note = f"{hands}; finding and reading"
        results.append(Result(f"{form}, 1,000 frames read", reading, None, "s", note=note))
        note = f"{hands}; per clip, with contacts, grasps, the object's preparation and the commit"
        results.append(Result(f"{form}, 1,000 frames imported", whole, None, "s", note=note))
    return results


@contextmanager
def _written(form: str) -> Iterator[tuple[Path, Truth]]:
    with TemporaryDirectory() as folder:
        root = Path(folder) / form
        yield root, WRITERS[form](root, N_FRAMES)
