"""``grasps`` and ``webdataset``: static grasps for models that generate grasps, as NPZ or tar shards."""

import io
import json
import tarfile
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb.export.grasp_arrays import ARRAYS, OBJECT_ARRAYS, TEXTS, arrays, object_choice, texts
from graspdb.export.held import HeldObject, HeldReader
from graspdb.export.items import Grasp
from graspdb.export.objects import ObjectMeshes, object_name
from graspdb.export.registry import Feature, Format, Part, Writer, Written, export_format

SHARD: Final = 256
"""Grasps of a shard."""

Sample = tuple[dict[str, str], dict[str, np.ndarray]]


class _Samples(Writer[Grasp]):
    """Samples of fixed shape, and the objects they name, each written once."""

    def samples(self, part: Part[Grasp]) -> Iterator[Sample]:
        """Yield the texts and arrays of each grasp."""
        chosen: dict[str, NDArray[np.int64]] = {}
        for held in HeldReader(self.database).read(list(part.items)):
            key = held.cloud.key
            if key not in chosen:
                chosen[key] = object_choice(held.cloud.points)
                self._write_object(held, chosen[key])
            name = object_name(held)
            mesh = f"objects/{name}.ply" if (self.folder / "objects" / f"{name}.ply").exists() else ""
            yield texts(held, mesh, f"objects/{name}.npz"), arrays(held, chosen[key])

    def features(self) -> Sequence[Feature]:
        """Return what the files hold."""
        return (*TEXTS, *ARRAYS, *OBJECT_ARRAYS)

    def _write_object(self, held: HeldObject, chosen: NDArray[np.int64]) -> None:
        folder = self.folder / "objects"
        folder.mkdir(exist_ok=True)
        path, cloud = folder / f"{object_name(held)}.npz", held.cloud
        if path.exists():
            return
        ObjectMeshes(self.folder, ".ply").of(held)
        scratch = path.with_suffix(".part")
        with scratch.open("wb") as file:
            np.savez(
                file,
                object_cloud=cloud.points[chosen].astype(np.float32),
                object_normals=cloud.normals[chosen].astype(np.float32),
                object_points=chosen.astype(np.int32),
            )
        scratch.replace(path)


@export_format(Format("grasps", "Static grasps of fixed shape as NPZ shards", items="grasps", part=SHARD))
class NpzWriter(_Samples):
    """``grasps-00000.npz``: every array of a sample, stacked."""

    def write(self, part: Part[Grasp]) -> Written:
        """Write the grasps of a part as one shard."""
        samples = list(self.samples(part))
        columns: dict[str, np.ndarray] = {
            text.name: np.array([sample[0][text.name] for sample in samples]) for text in TEXTS
        }
        columns |= {array.name: np.stack([sample[1][array.name] for sample in samples]) for array in ARRAYS}
        np.savez(self.folder / f"{_shard_name(part)}.npz", allow_pickle=False, **columns)
        return Written(part.split, {"grasps": len(samples), "shards": 1})


@export_format(
    Format("webdataset", "Static grasps of fixed shape as WebDataset tar shards", items="grasps", part=SHARD)
)
class WebDatasetWriter(_Samples):
    """``grasps-00000.tar``: for each grasp ``<number>.json`` with its texts, and ``<number>.<array>.npy``."""

    def write(self, part: Part[Grasp]) -> Written:
        """Write the grasps of a part as one shard."""
        count = 0
        with tarfile.open(self.folder / f"{_shard_name(part)}.tar", "w") as tar:
            for count, (words, numbers) in enumerate(self.samples(part), 1):
                key = f"{part.first + count - 1:09}"
                _add(tar, f"{key}.json", json.dumps(words).encode())
                for name, values in numbers.items():
                    _add(tar, f"{key}.{name}.npy", _npy(values))
        return Written(part.split, {"grasps": count, "shards": 1})


def _shard_name(part: Part[Grasp]) -> str:
    return f"{part.split}-{part.index:05}" if part.split else f"grasps-{part.index:05}"


def _npy(values: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, values, allow_pickle=False)
    return file.getvalue()


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    """Add a file with nothing about it that differs from run to run."""
    info = tarfile.TarInfo(name)
    info.size = len(content)
    tar.addfile(info, io.BytesIO(content))
