"""What a user asks of an export, beside the format and the place."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Final

from graspdb_schemas.errors import ParameterError, nearest

SPLITS: Final = ("subject", "object", "session", "random")
"""What each side of a split has to itself; ``random`` is by trial."""

STATES: Final = ("configuration", "sites")
"""What stands for the hand: its configuration q (30 numbers), or the centres of its 20 sites (60)."""

MISSING: Final = ("drop", "mask")
"""What becomes of frames in which the hand or the object is not known."""


@dataclass(frozen=True)
class ExportOptions:
    """What a user asks of an export.

    Attributes
    ----------
    where : str or None
        A boolean SQL expression over the columns of `grasps`; only those for which it is true are exported.
    split : {'subject', 'object', 'session', 'random'} or None
        What the sides of the split, train and valid, do not share; None for no split.
    seed : int
        Decides which side a group falls on, together with its name alone.
    fps : int or None
        Frames a second of episodes; None for the lowest rate of the trials, rounded.
    state : {'configuration', 'sites'}
        What stands for the hand in episodes.
    missing : {'drop', 'mask'}
        Frames without a pose are left out with what lies beyond them, or kept, filled and marked.
    retarget : str or None
        Configuration of dex-retargeting for a robot hand that is to follow.

    Raises
    ------
    ParameterError
        If a value is none of those allowed.
    """

    where: str | None = None
    split: str | None = None
    seed: int = 0
    fps: int | None = None
    state: str = "configuration"
    missing: str = "drop"
    retarget: str | None = None

    def __post_init__(self) -> None:
        if self.split is not None and self.split not in SPLITS:
            raise ParameterError("split", self.split, ", ".join(SPLITS))
        if self.fps is not None and not (isinstance(self.fps, int) and 1 <= self.fps <= 1000):
            raise ParameterError("fps", self.fps, "a whole number from 1 to 1000")
        if self.state not in STATES:
            raise ParameterError("state", self.state, ", ".join(STATES))
        if self.missing not in MISSING:
            raise ParameterError("missing", self.missing, ", ".join(MISSING))

    def given(self) -> dict[str, Any]:
        """Return the options that differ from their defaults."""
        defaults = {field.name: field.default for field in fields(self)}
        return {name: value for name, value in asdict(self).items() if value != defaults[name]}


def export_options(given: Mapping[str, Any]) -> ExportOptions:
    """Return options by name; those that are not given have their defaults.

    Raises
    ------
    ParameterError
        There is no such option, or its value is none of those allowed.
    """
    names = [field.name for field in fields(ExportOptions)]
    for name in given:
        if name not in names:
            raise ParameterError("option", name, ", ".join(names) + nearest(name, names))
    return ExportOptions(**given)
