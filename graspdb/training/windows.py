"""Windows of steps: any by its number (`WindowDataset`), or one after another (`WindowStream`).

Both are what ``torch.utils.data.DataLoader`` takes, with workers; torch is needed for neither.
"""

import os
import sys
from collections import OrderedDict
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from graspdb.training.sources import EpisodeArrays, open_source
from graspdb_schemas.errors import ParameterError

if TYPE_CHECKING:
    from graspdb.database import Database

Window = dict[str, Any]
"""Feature -> values, shape (horizon, ...); ``is_pad``, ``episode`` and ``step``."""

CACHE: Final = 2**30
"""Bytes of episodes that a process keeps."""

TOGETHER: Final = 16
"""Episodes that are read together, and whose windows a stream mixes."""


class WindowDataset:
    """Windows by number, one beginning at every step of every episode.

    Parameters
    ----------
    source : str, path or Database
        A database, or a folder that ``graspdb export lerobot`` wrote. Of a database that is read as it was
        when this was made, in every worker.
    horizon : int
        Steps of a window. Beyond the end of an episode its last step is repeated, and `is_pad` is true.
    only : {'train', 'valid'}, optional
        One side of the split: of an export the one that it was written with, of a database that of `split`.
    **options
        For a database: where, split, seed, fps, state and missing, as for an export.

    Raises
    ------
    ParameterError
        If an argument is not allowed.
    QueryError
        If nothing is selected.
    ExportError
        If a folder is no such export, or there is no step to train with.

    Notes
    -----
    An item has ``observation.state`` (horizon, s), ``observation.environment_state`` (horizon, 27) and
    ``action`` (horizon, s) in float32, with ``missing="mask"`` also ``hand_known``, ``object_known`` and
    ``contact_known`` (horizon,); ``is_pad`` (horizon,); and the numbers of ``episode`` and ``step``.
    """

    def __init__(
        self,
        source: "str | os.PathLike[str] | Database",
        horizon: int = 1,
        *,
        only: str | None = None,
        **options: Any,
    ) -> None:
        _check_horizon(horizon)
        self.horizon = horizon
        self._source = open_source(source, only, options)
        self._ends = np.cumsum(self._source.lengths())
        self._kept: OrderedDict[int, EpisodeArrays] = OrderedDict()
        self._bytes = 0
        if not len(self):
            raise ParameterError("source", source, "what has an episode with two steps in which all is known")

    def __len__(self) -> int:
        """Return the number of windows."""
        return int(self._ends[-1])

    def __getitem__(self, index: int) -> Window:
        """Return one window."""
        number = index + len(self) if index < 0 else index
        if not 0 <= number < len(self):
            raise IndexError(f"window {index} of {len(self)}")
        episode = int(np.searchsorted(self._ends, number, side="right"))
        arrays = self._episode(episode)
        step = number - int(self._ends[episode]) + len(arrays["action"])
        return _window(arrays, episode, step, self.horizon)

    def __getstate__(self) -> dict[str, Any]:
        """Return all but the episodes that are kept."""
        return {**self.__dict__, "_kept": OrderedDict(), "_bytes": 0}

    def _episode(self, number: int) -> EpisodeArrays:
        """Return an episode, from those kept if it is there; those not used for longest make room."""
        if number not in self._kept:
            # Reading its neighbours, too, costs little more, and each is asked for in every epoch.
            first = number - number % TOGETHER
            numbers = range(first, min(first + TOGETHER, self._source.n_episodes))
            for one, arrays in zip(numbers, self._source.read(numbers), strict=True):
                if arrays is not None and one not in self._kept:
                    self._kept[one] = arrays
                    self._bytes += _size(arrays)
        self._kept.move_to_end(number)
        while self._bytes > CACHE and len(self._kept) > 1:
            self._bytes -= _size(self._kept.popitem(last=False)[1])
        return self._kept[number]


class WindowStream:
    """Windows one after another, of each epoch all, shared out among workers by episodes.

    Parameters
    ----------
    source, horizon, only, **options
        As for `WindowDataset`.
    shuffle : int, optional
        A seed: episodes come in a random order, another in every epoch, and windows of 16 episodes are mixed.
        Without it they come in order.

    Notes
    -----
    Where torch is loaded when this is made, it is a ``torch.utils.data.IterableDataset``. Call `set_epoch`
    before every epoch but the first, or all have one order.
    """

    def __new__(cls, *_: Any, **__: Any) -> "WindowStream":
        """Return one that torch knows as iterable, where torch is there."""
        if cls is WindowStream and "torch" in sys.modules:
            from graspdb.training.torch_stream import TorchWindowStream

            return super().__new__(TorchWindowStream)
        return super().__new__(cls)

    def __init__(
        self,
        source: "str | os.PathLike[str] | Database",
        horizon: int = 1,
        *,
        only: str | None = None,
        shuffle: int | None = None,
        **options: Any,
    ) -> None:
        _check_horizon(horizon)
        self.horizon = horizon
        self.shuffle = shuffle
        self.epoch = 0
        self._source = open_source(source, only, options)

    def set_epoch(self, epoch: int) -> None:
        """Say which epoch comes next, for another order."""
        self.epoch = epoch

    def __iter__(self) -> Iterator[Window]:
        """Yield this worker's windows of the epoch."""
        worker, n_workers = _worker()
        rng = None if self.shuffle is None else np.random.default_rng([self.shuffle, self.epoch])
        order = (
            np.arange(self._source.n_episodes) if rng is None else rng.permutation(self._source.n_episodes)
        )
        own = order[worker::n_workers]
        for start in range(0, len(own), TOGETHER):
            numbers = own[start : start + TOGETHER].tolist()
            read = zip(numbers, self._source.read(numbers), strict=True)
            yield from self._windows([(number, one) for number, one in read if one is not None], rng)

    def _windows(
        self, episodes: list[tuple[int, EpisodeArrays]], rng: np.random.Generator | None
    ) -> Iterator[Window]:
        """Yield all windows of some episodes."""
        places = [
            (i, step) for i, (_, arrays) in enumerate(episodes) for step in range(len(arrays["action"]))
        ]
        for place in range(len(places)) if rng is None else rng.permutation(len(places)):
            i, step = places[place]
            number, arrays = episodes[i]
            yield _window(arrays, number, step, self.horizon)


def _window(arrays: EpisodeArrays, episode: int, step: int, horizon: int) -> Window:
    """Return the window that begins at a step."""
    steps = step + np.arange(horizon)
    last = len(arrays["action"]) - 1
    there: NDArray[np.int64] = np.minimum(steps, last)
    return {
        **{name: values[there] for name, values in arrays.items()},
        "is_pad": steps > last,
        "episode": episode,
        "step": step,
    }


def _worker() -> tuple[int, int]:
    """Return which of how many workers of a torch DataLoader this process is."""
    torch_data = sys.modules.get("torch.utils.data")
    info = None if torch_data is None else torch_data.get_worker_info()
    return (0, 1) if info is None else (info.id, info.num_workers)


def _check_horizon(horizon: int) -> None:
    if not (isinstance(horizon, int) and horizon >= 1):
        raise ParameterError("horizon", horizon, "a whole number, 1 or more")


def _size(arrays: EpisodeArrays) -> int:
    return sum(values.nbytes for values in arrays.values())
