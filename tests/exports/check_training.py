"""Load windows of a database and of its export with torch's DataLoader, with workers of both kinds.

Runs in an environment of its own: python tests/exports/check_training.py DATABASE EXPORT
"""

import sys
from importlib.metadata import version

import graspdb

BATCH = 64
HORIZON = 8


def main() -> None:
    """Check a database and say what was found."""
    database, export = sys.argv[1:]
    before = graspdb.WindowStream(export, HORIZON)
    assert "torch" not in sys.modules
    expected = {(window["episode"], window["step"]) for window in before}

    import torch
    from torch.utils.data import DataLoader, IterableDataset

    read = 0
    for source, options in ((database, {"fps": 30, "split": "object"}), (export, {})):
        by_number = graspdb.WindowDataset(source, HORIZON, **options)
        stream = graspdb.WindowStream(source, HORIZON, shuffle=0, **options)
        assert isinstance(stream, IterableDataset)
        loaders = [
            DataLoader(by_number, BATCH, shuffle=True, num_workers=2),
            DataLoader(stream, BATCH, num_workers=2),
            DataLoader(stream, BATCH, num_workers=2, multiprocessing_context="spawn"),
        ]
        for loader in loaders:
            found = []
            for batch in loader:
                assert batch["action"].dtype == torch.float32
                assert batch["action"].shape[1:] == (HORIZON, 30)
                found += zip(batch["episode"].tolist(), batch["step"].tolist(), strict=True)
            # Episodes of a database that have no steps have numbers, too.
            assert len(set(found)) == len(found) == len(by_number)
            assert source is database or set(found) == expected
            read += len(found)
    print(f"torch {version('torch')}: {read} windows through six DataLoaders of two workers")


if __name__ == "__main__":
    main()
