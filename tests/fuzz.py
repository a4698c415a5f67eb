"""Damaged sessions through ``graspdb check``, in one process whose memory is limited.

    python tests/fuzz.py 10000 [FIRST]

Each number makes one session with one damaged file: a recording, a mesh, a cloud or the manifest. What a user
can cause has to end as a report or a message: an exception that escapes, a crash, or an input that takes
longer than `_LONGEST` ends the run with the number that made it.
"""

import faulthandler
import io
import json
import random
import re
import resource
import struct
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

import numpy as np
import recording_files as write
import trimesh
import yaml

from graspdb.cli import _run
from graspdb_schemas.vocabulary import SITES

MEMORY: Final = 2 * 2**30
"""Bytes of data that the process may have."""

_LONGEST: Final = 120
"""Seconds after which an input counts as a hang; a C3D file that hangs ezc3d takes 21."""

_LABELS: Final = [*(f"forearm_{i}" for i in range(1, 5)), *SITES, "m1", "m2", "m3"]
_OBJECT_MARKERS: Final = {"m1": [0, 0, 0], "m2": [50, 0, 0], "m3": [0, 50, 10]}
_NUMBERS: Final = (
    "nan", "inf", "-inf", "1e400", "1e308", "-1", "0", "65536", "2147483648", "4294967296", "1" * 400,
    "9" * 5000, "0x10", "1_000", "", "٣", "\x00", "1,5", "--1", "1e", "true", "null",
)  # fmt: skip
_WORDS: Final = tuple(
    struct.pack(kind, value)
    for kind, values in {
        "<h": (-1, 0, 1, 32767, -32768),
        "<i": (-1, 0, 2**31 - 1, -(2**31)),
        "<f": (float("nan"), float("inf"), -1.0, 1e38, 0.0),
        "<d": (float("nan"), 1e308),
        "<q": (-1, 2**62),
    }.items()
    for value in values
)
_YAML: Final = (
    "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{b}: &{b} [{', '.join(['*' + a] * 9)}]\n" for a, b in zip("abcdefghi", "bcdefghij", strict=True)
    ),
    "a: &a {<<: *a}\n", "a: &a [*a]\n", "[" * 5000, "{a: " * 3000, "- " * 4000 + "x", "? [a, b]\n: c\n",
    "!!python/object/apply:os.system ['true']\n", "!!binary x\n", "a: !!timestamp 2001-01-01\n", "---\n---\n",
    "? " * 3000, "a: &x\n  - *y\n", "\ufeffa: b\n", "a: 1e999\n", "a: 0o7777777777777777777777\n",
    "a: " + "9" * 20000 + "\n", "a: 1:59:59:59:59:59:59:59\n", "%YAML 9.9\n---\n", "\t\n",
    "a: |\n" + " x\n" * 5000,
)  # fmt: skip


def make_session(folder: Path, number: int) -> str:
    """Write the session of a number into an empty folder and return what is damaged in it."""
    rng = random.Random(number)
    names = [*_RECORDINGS, *_OBJECTS, "session.yaml"]
    damaged = names[number % len(names)]
    recording = damaged if damaged in _RECORDINGS else "plain.csv"
    thing = damaged if damaged in _OBJECTS else "binary.stl"
    for name, make in ((recording, _RECORDINGS[recording]), (thing, _OBJECTS[thing])):
        make(folder / name, rng)
    manifest = {
        "graspdb_session": 1,
        "id": "fuzz",
        "units": "mm",
        "up": [0, 0, 1],
        "marker_set": "forearm4-dorsal20",
        "subjects": {"p": {"hand": "right", "hand_length": 190, "hand_breadth": 85}},
        "objects": {"box": {"mesh": thing, "markers": _OBJECT_MARKERS}},
        "trials": [{"file": recording, "subject": "p", "object": "box", "start": 0.0}],
    }
    (folder / "session.yaml").write_text(yaml.safe_dump(manifest, sort_keys=False), encoding="utf-8")
    file = folder / damaged
    data = file.read_bytes()
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(_damages(damaged))(data, rng)
    file.write_bytes(data)
    return damaged


def check(folder: Path) -> int:
    """Run ``graspdb check`` in this process and return its exit status."""
    said = io.StringIO()
    with (
        patch.object(sys, "argv", ["graspdb", "check", str(folder)]),
        redirect_stdout(said),
        redirect_stderr(said),
    ):
        status = _run()
    if status not in (0, 1) or "Traceback" in said.getvalue():
        raise RuntimeError(f"exit status {status}: {said.getvalue()[-2000:]}")
    return status


def main(count: int, first: int = 0) -> bool:
    """Check damaged sessions, print what became of them, and return whether any was not contained."""
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    found: Counter[str] = Counter()
    slowest = (0.0, -1)
    failed = []
    for number in range(first, first + count):
        with tempfile.TemporaryDirectory() as name:
            damaged = make_session(Path(name), number)
            faulthandler.dump_traceback_later(_LONGEST, exit=True)
            start = time.monotonic()
            try:
                status = check(Path(name))
            except Exception:
                print(
                    f"input {number}, damaged {damaged}:\n{traceback.format_exc()}",
                    file=sys.stderr,
                    flush=True,
                )
                failed.append(number)
                continue
            slowest = max(slowest, (time.monotonic() - start, number))
            found[f"{damaged}: {'refused' if status else 'read'}"] += 1
    faulthandler.cancel_dump_traceback_later()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    report = {
        "inputs": count,
        "peak_MiB": round(peak),
        "slowest_s": round(slowest[0], 2),
        "slowest": slowest[1],
    }
    print(json.dumps(report | {"failed": failed} | dict(sorted(found.items()))))
    return bool(failed)


def _positions(rng: random.Random) -> Any:
    steps = np.random.default_rng(rng.randrange(2**32)).normal(
        0, 1, (rng.choice((2, 20, 60)), len(_LABELS), 3)
    )
    return 300 + 20 * np.arange(len(_LABELS))[None, :, None] + steps.cumsum(axis=0)


Maker = Callable[[Path, random.Random], object]

_RECORDINGS: Final[dict[str, Maker]] = {
    "points.c3d": lambda path, rng: write.write_c3d(path, _LABELS, _positions(rng), 100.0),
    "integers.c3d": lambda path, rng: path.write_bytes(
        write.c3d_bytes(_positions(rng), _LABELS, 100.0, scale=0.1)
    ),
    "markers.trc": lambda path, rng: write.write_trc(path, _LABELS, _positions(rng), 100.0),
    "qualisys.tsv": lambda path, rng: write.write_qualisys(path, _LABELS, _positions(rng), 100.0),
    "plain.csv": lambda path, rng: write.write_plain(path, _LABELS, _positions(rng), 100.0),
    "motive.csv": lambda path, rng: write.write_optitrack(
        path, dict(zip(_LABELS, _positions(rng).transpose(1, 0, 2), strict=True)), 100.0, units="Millimeters"
    ),
}


def _mesh(rng: random.Random) -> Any:
    return rng.choice((trimesh.creation.box((90, 60, 40)), trimesh.creation.icosphere(2, 40)))


_OBJECTS: Final[dict[str, Maker]] = {
    "binary.stl": lambda path, rng: _mesh(rng).export(path),
    "text.stl": lambda path, rng: _mesh(rng).export(path, file_type="stl_ascii"),
    "binary.ply": lambda path, rng: _mesh(rng).export(path),
    "text.ply": lambda path, rng: path.write_bytes(_mesh(rng).export(file_type="ply", encoding="ascii")),
    "cloud.ply": lambda path, rng: trimesh.PointCloud(_mesh(rng).vertices).export(path),
    "mesh.obj": lambda path, rng: _mesh(rng).export(path),
}

Damage = Callable[[bytes, random.Random], bytes]


def _damages(name: str) -> tuple[Damage, ...]:
    if name == "session.yaml":
        return (_flip, _cut, _number, _number, _repeat, _swap, _yaml, _yaml, _path)
    if name.endswith(".c3d") or name.startswith(("binary", "cloud")):
        return (
            _flip,
            _flip,
            _flip_early,
            _flip_early,
            _cut,
            _word,
            _word_early,
            _word_early,
            _repeat,
            _erase,
        )
    return (_flip, _flip_early, _cut, _number, _number, _number_early, _number_early, _repeat, _swap, _erase)


def _place(data: bytes, rng: random.Random, early: bool = False) -> int:
    return rng.randrange(max(1, min(len(data), 700 if early else len(data))))


def _flip(data: bytes, rng: random.Random, early: bool = False) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 3, 20)) if data else 0):
        changed[_place(data, rng, early)] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _flip_early(data: bytes, rng: random.Random) -> bytes:
    return _flip(data, rng, early=True)


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _word(data: bytes, rng: random.Random, early: bool = False) -> bytes:
    place, word = _place(data, rng, early), rng.choice(_WORDS)
    return data[:place] + word + data[place + len(word) :]


def _word_early(data: bytes, rng: random.Random) -> bytes:
    return _word(data, rng, early=True)


def _repeat(data: bytes, rng: random.Random) -> bytes:
    start = _place(data, rng)
    part = data[start : start + rng.choice((1, 30, 500))]
    return data[:start] + part * rng.choice((2, 50, 2000)) + data[start:]


def _erase(data: bytes, rng: random.Random) -> bytes:
    start, length = _place(data, rng), rng.choice((1, 100, 3000))
    return (
        data[:start]
        + rng.choice((b"", b"\0" * length, b" " * length, rng.randbytes(length)))
        + data[start + length :]
    )


def _swap(data: bytes, rng: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    rng.shuffle(lines) if rng.random() < 0.2 else lines.insert(
        _place(b" " * len(lines), rng), rng.choice(lines or [b""])
    )
    return b"".join(lines)


def _number(data: bytes, rng: random.Random, early: bool = False) -> bytes:
    found = list(re.finditer(rb"[-+]?\d[\d.e+-]*", data[:700] if early else data))
    if not found:
        return data
    chosen = rng.choice(found)
    return data[: chosen.start()] + rng.choice(_NUMBERS).encode() + data[chosen.end() :]


def _number_early(data: bytes, rng: random.Random) -> bytes:
    return _number(data, rng, early=True)


def _yaml(data: bytes, rng: random.Random) -> bytes:
    part = rng.choice(_YAML).encode()
    return rng.choice((part, data + part, part + data, data.replace(b"right", part, 1)))


def _path(data: bytes, rng: random.Random) -> bytes:
    wanted = (
        "/etc/passwd",
        "../../etc/passwd",
        ".",
        "/dev/zero",
        "x" * 5000,
        "%00",
        "C:\\x",
        "session.yaml",
        "~",
    )
    return data.replace(rng.choice((b"plain.csv", b"binary.stl")), rng.choice(wanted).encode())


if __name__ == "__main__":
    sys.exit(main(*(int(argument) for argument in sys.argv[1:3])))
