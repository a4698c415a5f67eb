"""The stream of windows as torch knows it; imported only where torch is loaded already."""

from torch.utils.data import IterableDataset

from graspdb.training.windows import WindowStream


class TorchWindowStream(WindowStream, IterableDataset):  # type: ignore[misc]
    """A `WindowStream` that a DataLoader iterates over."""
