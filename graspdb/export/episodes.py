"""What the writers of episodes share: steps in place of frames, counted, all of one width."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspdb.export.errors import ExportError
from graspdb.export.items import Episode
from graspdb.export.registry import Feature, Part, Writer, Written
from graspdb.export.steps import Refused, Steps, step_columns, step_features, steps_of

EPISODE_OPTIONS: Final = ("fps", "state", "missing")
"""Options that writers of episodes heed."""

_DROPPED: Final = "steps in which hand, object or contacts are not known, or beyond such steps"

Stepped = tuple[Episode, Steps]


class EpisodeWriter(Writer[Episode]):
    """Writes episodes step by step."""

    def columns(self) -> Sequence[str]:
        """Return what steps are made of."""
        return step_columns(self.options)

    def write(self, part: Part[Episode]) -> Written:
        """Write those episodes of a part that have steps."""
        stepped: list[Stepped] = []
        left_out: dict[str, int] = {}
        width = self.width(part.before)
        for episode in part.items:
            steps = steps_of(episode, self.options)
            if isinstance(steps, Refused):
                left_out[steps.reason] = left_out.get(steps.reason, 0) + 1
                continue
            width = self._checked(episode, steps, width)
            left_out[_DROPPED] = left_out.get(_DROPPED, 0) + steps.dropped
            stepped.append((episode, steps))
        state = self.write_steps(part, stepped) if stepped else {}
        counts = {"episodes": len(stepped), "frames": int(episode_lengths(stepped).sum())}
        if self.options.missing == "mask":
            counts["filled"] = sum(int((~steps.known.all(axis=1)).sum()) for _, steps in stepped)
        return Written(part.split, counts, left_out, {**state, "n_state": width})

    def _checked(self, episode: Episode, steps: Steps, width: int) -> int:
        """Return the width of states, having checked that it is that of the episodes before."""
        found = int(steps.state.shape[1])
        if width not in (0, found):
            raise ExportError(
                self.folder,
                f"the hand of {episode.key} has {found} numbers in a state, those before it {width}",
                "Narrow the export to hands of one model with --where, or use --state sites.",
            )
        return found

    @staticmethod
    def width(written: Sequence[Written]) -> int:
        """Return how many numbers a state has; 0 where no episode was written yet."""
        return max((part.state["n_state"] for part in written), default=0)

    @abstractmethod
    def write_steps(self, part: Part[Episode], stepped: list[Stepped]) -> dict[str, Any]:
        """Write episodes, one or more, and return what `finish` needs to know of them."""

    def finish(self, written: Sequence[Written]) -> None:
        """Remember how wide states are."""
        self.n_state = self.width(written)

    def features(self) -> Sequence[Feature]:
        """Return what steps hold."""
        return step_features(self.n_state, self.options)


def before(part: Part[Any], name: str) -> int:
    """Return how many episodes, or frames, the parts before hold."""
    return sum(written.counts[name] for written in part.before)


def episode_lengths(stepped: Sequence[Stepped]) -> NDArray[np.int64]:
    """Return the number of steps of each episode."""
    return np.array([len(steps) for _, steps in stepped], dtype=np.int64)


def over(axis: str, shape: str) -> str:
    """Return a shape with an axis in front: ``(T, 30)`` of ``(30,)``, and ``(T,)`` of that of scalars."""
    numbers = shape.strip("(),")
    return f"({axis},)" if numbers == "1" else f"({axis}, {numbers})"
