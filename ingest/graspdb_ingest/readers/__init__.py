"""Readers of marker trajectories; importing this package registers them all."""

from graspdb_ingest.readers import c3d, optitrack, parquet, plain, qualisys, trc
from graspdb_ingest.readers.registry import Reader, read_recording, reader, readers

__all__ = [
    "Reader",
    "c3d",
    "optitrack",
    "parquet",
    "plain",
    "qualisys",
    "read_recording",
    "reader",
    "readers",
    "trc",
]
