"""How long a step of the live tracker takes, with contacts and without."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from harness import Result, benchmark
from numpy.typing import NDArray

from graspdb.simulate import NoiseParameters, simulate_session
from graspdb_ingest.live import HandTracker
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepared_object import PreparedObject, prepare_object
from graspdb_ingest.readers import read_recording
from graspdb_ingest.trial_markers import select_markers
from graspdb_schemas.manifest_reader import parse_manifest

RUNS = 10
"""Identical runs. A step counts with the least of its times, since other work on the machine delays some."""
NOISE = NoiseParameters(marker_sd=0.001, skin_sd=0.0, occlusion=0.1)

Floats = NDArray[np.floating[Any]]


@benchmark("live")
def live() -> Sequence[Result]:
    """Step through a simulated trial of grasping a mug at 120 Hz, again and again."""
    with TemporaryDirectory() as folder:
        session = simulate_session(
            Path(folder) / "session", subjects=1, objects=["mug"], kinds=["rim"], noise=NOISE, seed=1
        )
        manifest = parse_manifest(session.path)
        (trial,) = manifest.trials
        found = select_markers(read_recording(trial.file, manifest.file_scale), manifest, trial)
        thing = prepare_object(manifest.objects["mug"], IngestParameters())
    truth = session.truth.trials[trial.name]
    hand = session.truth.subjects[truth.subject].hand
    markers = found.hands[truth.side][:, [found.hand_labels.index(label) for label in hand.markers]]

    def measured(thing: PreparedObject | None) -> Floats:
        runs = []
        for _ in range(RUNS):
            with HandTracker(hand, rate_of(truth.times), thing) as tracker:
                runs.append(seconds(tracker, markers, found.object_markers))
        return np.array(runs)

    alone, with_contacts = measured(None), measured(thing)
    points = len(thing.cloud.points)
    return [
        _result("live step, 24 markers", alone, "at most 0.5 ms is allowed"),
        _result("live step, object and contacts too", with_contacts, f"gaps to {points:,} points"),
    ]


def rate_of(times: Floats) -> float:
    """Return the frames per second of evenly spaced times."""
    return float((len(times) - 1) / (times[-1] - times[0]))


def seconds(tracker: HandTracker, markers: Floats, object_markers: Floats) -> Floats:
    """Return the duration of every step after the first, in which the hand is found."""
    tracker.step(markers[0], object_markers[0])
    spent = np.empty(len(markers) - 1)
    for i in range(1, len(markers)):
        start = perf_counter()
        tracker.step(markers[i], object_markers[i])
        spent[i - 1] = perf_counter() - start
    return spent


def _result(name: str, spent: Floats, about: str) -> Result:
    steps, once = 1e3 * spent.min(axis=0), 1e3 * float(np.percentile(spent, 99))
    note = (
        f"99th percentile of {len(steps)} steps, each the least of {RUNS} times; {about}; "
        f"median {np.median(steps):.3f}, longest {steps.max():.2f}, all times' 99th percentile {once:.2f} ms"
    )
    return Result(name, float(np.percentile(steps, 99)), None, "ms", note=note)
