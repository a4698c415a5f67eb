"""``zarr``: the replay buffer of diffusion policy, all episodes behind each other, with where each ends.

It is written in version 2 of the Zarr format, which that project's release of the library reads.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from graspdb.export.episodes import EPISODE_OPTIONS, EpisodeWriter, Stepped, before, episode_lengths, over
from graspdb.export.items import Episode
from graspdb.export.registry import Feature, Format, Part, Written, export_format
from graspdb.export.split import VALID
from graspdb.export.steps import ACTION, ENVIRONMENT, STATE

FOLDER: Final = "replay_buffer.zarr"
ARRAYS: Final = {STATE: "state", ENVIRONMENT: "environment_state", ACTION: "action"}
"""Names of the arrays of steps."""

CHUNK: Final = 8192
"""Steps of a chunk, which is a file."""


@export_format(
    Format(
        "zarr",
        "Zarr in the layout of diffusion policy's replay buffer",
        items="episodes",
        options=EPISODE_OPTIONS,
        library="zarr",
    )
)
class ZarrWriter(EpisodeWriter):
    """Appends part after part; where a part begins follows from those before."""

    def write_steps(self, part: Part[Episode], stepped: list[Stepped]) -> dict[str, Any]:
        """Write the steps of a part behind those of the parts before."""
        start = before(part, "frames")
        columns = [steps.columns(self.options.missing) for _, steps in stepped]
        data = self._group().require_group("data")
        for name in columns[0]:
            _put(data, ARRAYS.get(name, name), np.concatenate([one[name] for one in columns]), start, CHUNK)
        meta = self._group().require_group("meta")
        ends = start + np.cumsum(episode_lengths(stepped))
        first = before(part, "episodes")
        _put(meta, "episode_ends", ends, first, CHUNK)
        if part.split:
            _put(meta, "episode_valid", np.full(len(ends), part.split == VALID), first, CHUNK)
        return {}

    def _group(self) -> Any:
        import zarr

        return zarr.open_group(self.folder / FOLDER, mode="a", zarr_format=2)

    def finish(self, written: Sequence[Written]) -> None:
        """Note the rate."""
        super().finish(written)
        self._group().attrs["fps"] = self.options.fps

    def features(self) -> Sequence[Feature]:
        """Return what the arrays hold."""
        steps = [
            Feature(
                f"data/{ARRAYS.get(feature.name, feature.name)}",
                feature.kind,
                over("N", feature.shape),
                feature.unit,
                feature.doc,
            )
            for feature in super().features()
        ]
        ends = Feature("meta/episode_ends", "int64", "(E,)", "", "steps up to the end of each episode")
        valid = Feature("meta/episode_valid", "bool", "(E,)", "", "whether it is on the side to validate")
        return [*steps, ends, *([valid] if self.options.split else [])]


def _put(group: Any, name: str, values: np.ndarray[Any, Any], start: int, chunk: int) -> None:
    """Write rows from `start` on, as the last of an array that is made where there is none."""
    if name not in group:
        chunks = (chunk, *values.shape[1:])
        group.create_array(name, shape=(0, *values.shape[1:]), chunks=chunks, dtype=values.dtype)
    array = group[name]
    array.resize((start + len(values), *values.shape[1:]))
    array[start:] = values
