"""C3D files through ezc3d in a process of its own, which is started once and asked file by file.

Files whose skeleton is sound can still have it crash or run on forever. Then that process ends, not this one.
"""

import atexit
import json
import math
import os
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from numpy.typing import NDArray

from graspdb_schemas.errors import RecordingError

_AGAIN: Final = "Export the recording again, or copy it again."

_SECONDS: Final = 20.0
_BYTES_A_SECOND: Final = 1e6
"""How long any file may take, and how much longer by its size; ezc3d is a hundred times faster."""

_MEMORY: Final = 2**30
_MEMORY_A_BYTE: Final = 64
"""Memory that reading any file may take, and how much more for each of its bytes."""


@dataclass(frozen=True)
class C3DContent:
    """What ezc3d read of a file.

    Attributes
    ----------
    rate : float
        Frame rate in the header [Hz].
    first_frame : int
        Number of the first frame.
    parameters : mapping of str to mapping of str to sequence
        Values of the groups POINT and TRIAL.
    points : ndarray, shape (n_frames, n_points, 3)
        Positions, in the file's unit.
    residuals : ndarray, shape (n_frames, n_points)
        Residuals; below zero where a point was not seen.
    """

    rate: float
    first_frame: int
    parameters: Mapping[str, Mapping[str, Sequence[Any]]]
    points: NDArray[np.float64]
    residuals: NDArray[np.float64]

    def values(self, group: str, name: str) -> Sequence[Any]:
        """Return the values of a parameter, empty where there is none."""
        found = self.parameters.get(group, {}).get(name, ())
        return found if isinstance(found, list) else [found] if found != () else ()


class _Child:
    """The process, started when it is first needed and again after it was lost."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0
        self._lock = threading.Lock()

    def read(self, path: Path, seconds: float, memory: int) -> C3DContent:
        """Ask for one file."""
        with self._lock:
            process = self._running()
            late = threading.Timer(seconds, process.kill)
            late.start()
            try:
                return self._ask(process, path, memory)
            except (OSError, EOFError, ValueError) as error:
                self._stop()
                expired = late.finished.is_set()
                found = "it keeps ezc3d busy without end" if expired else "it makes ezc3d crash"
                raise RecordingError(path, f"it is damaged: {found}", _AGAIN) from error
            except BaseException:  # Ctrl-C: what is left of the answer must not answer the next question
                self._stop()
                raise
            finally:
                late.cancel()

    def stop(self) -> None:
        """End the process."""
        with self._lock:
            self._stop()

    def _running(self) -> "subprocess.Popen[bytes]":
        if self._owner != os.getpid():  # after a fork the other process's child is not ours to ask
            self._process, self._owner = None, os.getpid()
        if self._process is None or self._process.poll() is not None:
            self._process = subprocess.Popen(
                [sys.executable, "-P", str(Path(__file__).with_name("c3d_child.py"))],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                process_group=0,  # Ctrl-C is for this process
            )
        return self._process

    def _ask(self, process: "subprocess.Popen[bytes]", path: Path, memory: int) -> C3DContent:
        asked, answers = process.stdin, process.stdout
        if asked is None or answers is None:
            raise OSError("no pipes")
        asked.write(json.dumps({"path": str(path), "memory": memory}).encode() + b"\n")
        asked.flush()
        said = json.loads(_line(answers))
        if "error" in said:
            raise RecordingError(path, f"ezc3d cannot read it ({said['error']})", _AGAIN)
        shape = tuple(said["shape"])
        points, residuals = _array(answers, (*shape, 3)), _array(answers, shape)
        return C3DContent(said["rate"], said["first_frame"], said["parameters"], points, residuals)

    def _stop(self) -> None:
        if self._process is not None and self._owner == os.getpid():
            self._process.kill()
            self._process.communicate()
        self._process = None


_CHILD: Final = _Child()
atexit.register(_CHILD.stop)


def read_content(path: Path) -> C3DContent:
    """Return what ezc3d reads of a file.

    Raises
    ------
    RecordingError
        If it cannot read it, crashes, or does not come to an end.
    """
    size = path.stat().st_size
    memory = _MEMORY + _MEMORY_A_BYTE * size
    return _CHILD.read(path.resolve(), _SECONDS + size / _BYTES_A_SECOND, memory)


def _array(stream: IO[bytes], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return an array of the answer, which may be written to."""
    data = bytearray(8 * math.prod(shape))
    if stream.readinto(data) != len(data):  # type: ignore[attr-defined]
        raise EOFError
    return np.frombuffer(data, dtype=np.float64).reshape(shape)


def _line(stream: IO[bytes]) -> bytes:
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    return line
