"""What runs beside graspdb and reads C3D files: a damaged one can crash ezc3d, or keep it busy forever.

It is asked by lines of JSON on standard input, and answers on standard output with a line of JSON and, where
the file could be read, the bytes of two arrays: positions and residuals. It ends with its input.
"""

import json
import os
import resource
import sys
from typing import IO, Any

import ezc3d
import numpy as np

_GROUPS = ("POINT", "TRIAL")


def main() -> None:
    """Answer until standard input ends."""
    # What the library prints is no part of the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    for line in sys.stdin:
        asked = json.loads(line)
        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        allowed = asked["memory"] if most == resource.RLIM_INFINITY else min(asked["memory"], most)
        resource.setrlimit(resource.RLIMIT_DATA, (allowed, most))
        _answer(asked["path"], answers)
        answers.flush()


def _answer(path: str, answers: IO[bytes]) -> None:
    try:
        file = ezc3d.c3d(path)
        points = np.ascontiguousarray(file["data"]["points"][:3].transpose(2, 1, 0), dtype=np.float64)
        residuals = np.ascontiguousarray(file["data"]["meta_points"]["residuals"][0].T, dtype=np.float64)
        said = json.dumps(_described(file) | {"shape": residuals.shape})
    except Exception as error:  # whatever a damaged file leads the library to
        answers.write(json.dumps({"error": str(error) or type(error).__name__}).encode() + b"\n")
        return
    for part in (said.encode(), b"\n", points.tobytes(), residuals.tobytes()):
        answers.write(part)


def _described(file: Any) -> dict[str, Any]:
    """Return header and parameters as JSON has them."""
    header, parameters = file["header"]["points"], file["parameters"]
    return {
        "rate": float(header["frame_rate"]),
        "first_frame": int(header["first_frame"]),
        "parameters": {
            group: {
                name: np.asarray(entry["value"]).tolist()
                for name, entry in parameters[group].items()
                if isinstance(entry, dict) and "value" in entry
            }
            for group in _GROUPS
            if group in parameters
        },
    }


if __name__ == "__main__":
    main()
