"""``hdf5``: the layout of robomimic 0.3, one demonstration an episode.

A file of HDF5 that is written when the machine stops may be lost as a whole. So each part is a file of its
own, and the one file is made of them at the end.
"""

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from graspdb.export.episodes import EPISODE_OPTIONS, EpisodeWriter, Stepped, before, over
from graspdb.export.items import Episode
from graspdb.export.journal import UNFINISHED
from graspdb.export.registry import Feature, Format, Part, Written, export_format
from graspdb.export.steps import ACTION, ENVIRONMENT, KNOWN, STATE, Steps

FILE: Final = "demos.hdf5"
OBSERVED: Final = {"state": STATE, "environment_state": ENVIRONMENT}
"""Names of observations in the file, which may have no dot where a trainer makes modules of them."""

_GYM: Final = 2
"""robomimic's number for an environment of Gym; there is none, but its loader wants a number."""


@export_format(
    Format(
        "hdf5",
        "HDF5 in robomimic's layout, one demonstration a hand and trial",
        items="episodes",
        options=EPISODE_OPTIONS,
        library="h5py",
    )
)
class Hdf5Writer(EpisodeWriter):
    """Writes a file a part, and joins them at the end."""

    def write_steps(self, part: Part[Episode], stepped: list[Stepped]) -> dict[str, Any]:
        """Write the demonstrations of a part into a file of its own."""
        import h5py

        first = before(part, "episodes")
        with h5py.File(self._part_file(part.index), "w") as file:
            for number, (episode, steps) in enumerate(stepped, first):
                self._write_demo(file.create_group(f"demo_{number}"), episode, steps)
        return {"file": part.index}

    def _part_file(self, index: int) -> Path:
        return self.folder / UNFINISHED / f"part-{index}.hdf5"

    def _write_demo(self, demo: Any, episode: Episode, steps: Steps) -> None:
        last = np.zeros(len(steps))
        last[-1] = 1
        columns = steps.columns(self.options.missing)
        demo.create_dataset("actions", data=columns[ACTION])
        demo.create_dataset("rewards", data=last)
        demo.create_dataset("dones", data=last.astype(np.int64))
        observed = {name: columns[column] for name, column in OBSERVED.items()}
        for name, values in observed.items():
            demo.create_dataset(f"obs/{name}", data=values)
            demo.create_dataset(f"next_obs/{name}", data=np.concatenate([values[1:], values[-1:]]))
        for name in KNOWN if self.options.missing == "mask" else ():
            demo.create_dataset(name, data=columns[name])
        demo.attrs["num_samples"] = len(steps)
        for name in ("trial", "side", "subject", "object", "task"):
            demo.attrs[name] = getattr(episode, name)
        demo.attrs["grasps"] = list(episode.grasps)
        demo.attrs["start_time"] = steps.start

    def finish(self, written: Sequence[Written]) -> None:
        """Join the parts, and add what holds for all."""
        import h5py

        super().finish(written)
        unfinished = self.folder / UNFINISHED / FILE
        with h5py.File(unfinished, "w") as file:
            data = file.create_group("data")
            for part in written:
                if "file" in part.state:
                    with h5py.File(self._part_file(part.state["file"]), "r") as source:
                        for name in source:
                            source.copy(name, data)
            data.attrs["total"] = sum(part.counts["frames"] for part in written)
            data.attrs["env_args"] = json.dumps({"env_name": "graspdb", "type": _GYM, "env_kwargs": {}})
            data.attrs["fps"] = self.options.fps
            for side, names in _demos(written).items():
                file[f"mask/{side}"] = np.array(names, dtype="S")
        shutil.move(unfinished, self.folder / FILE)

    def features(self) -> Sequence[Feature]:
        """Return what a demonstration holds."""
        by_name = {feature.name: feature for feature in super().features()}
        return [
            *(_renamed(by_name[column], f"obs/{name}") for name, column in OBSERVED.items()),
            Feature(
                "next_obs/...",
                "float32",
                "as obs",
                "as obs",
                "observations of the next step; the last its own",
            ),
            _renamed(by_name[ACTION], "actions"),
            Feature("rewards", "float64", "(T,)", "", "1 in the last step, 0 before"),
            Feature("dones", "int64", "(T,)", "", "1 in the last step, 0 before"),
            *(_renamed(by_name[name], name) for name in KNOWN if name in by_name),
        ]


def _renamed(feature: Feature, name: str) -> Feature:
    return Feature(name, feature.kind, over("T", feature.shape), feature.unit, feature.doc)


def _demos(written: Sequence[Written]) -> dict[str, list[str]]:
    """Return the names of the demonstrations on each side of the split; none where there is no split."""
    demos: dict[str, list[str]] = {}
    first = 0
    for part in written:
        end = first + part.counts["episodes"]
        if part.split:
            demos.setdefault(part.split, []).extend(f"demo_{number}" for number in range(first, end))
        first = end
    return demos
