"""A digit whose markers are all hidden for a second, with a data glove and without."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from harness import Result, benchmark
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from graspdb.simulate import NoiseParameters, TrialTruth, simulate_session
from graspdb_ingest.glove_angles import GloveAngles, select_glove
from graspdb_ingest.hand import HandModel
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.readers import read_recording
from graspdb_ingest.readers.glove import read_glove
from graspdb_ingest.tracking.fit import FREE, SEVEN
from graspdb_ingest.tracking.glove import fit_glove
from graspdb_ingest.tracking.tracker import HandTrack, track_hand
from graspdb_ingest.trial_markers import select_markers
from graspdb_schemas.manifest_reader import parse_manifest
from graspdb_schemas.vocabulary import DIGITS, SITES

HIDDEN = 1.0
"""How long a digit is hidden [s]."""
NOISE = NoiseParameters(marker_sd=0.001, skin_sd=0.0, occlusion=0.0, glove_sd=float(np.deg2rad(3)))
PARAMETERS = IngestParameters()

Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Worn:
    """A simulated trial of a hand that wears a glove, as it was recorded."""

    truth: TrialTruth
    hand: HandModel
    markers: Floats
    rate: float
    glove: GloveAngles


@benchmark("glove")
def glove() -> Sequence[Result]:
    """Hide each digit of every simulated trial in turn, and compare its tip with the truth."""
    with TemporaryDirectory() as folder:
        trials = recorded(Path(folder) / "session")
    rng, errors, sds = np.random.default_rng(0), [], []
    with threadpool_limits(1):
        for trial in trials:
            for digit in DIGITS:
                error, sd = errors_of(trial, digit, rng)
                errors.append(error)
                sds.append(sd)
    alone, helped = (float(np.mean(np.concatenate([e[i] for e in errors]))) for i in (0, 1))
    within = float(np.mean(np.concatenate([e[1] < 2 * sd for e, sd in zip(errors, sds, strict=True)])))
    setting = "3 degrees of noise and 5 of offset for each sensor, clocks 50 ms apart at most"
    return [
        Result(
            "tip of a digit hidden for 1 s, with a glove",
            1e3 * helped,
            1e3 * alone,
            "mm",
            note=f"{setting}; at most 4 mm is allowed; peer: the same without the glove",
        ),
        Result(
            "the same, within two standard deviations",
            within,
            None,
            "1",
            "more",
            note="of the true position; at least 0.93 is allowed",
        ),
    ]


def recorded(folder: Path) -> list[Worn]:
    """Return simulated trials with true hand sizes."""
    session = simulate_session(folder, subjects=1, objects=["mug"], noise=NOISE, seed=5, gloves=True)
    manifest = parse_manifest(folder)
    trials = []
    for trial in manifest.trials:
        truth = session.truth.trials[trial.name]
        hand = session.truth.subjects[truth.subject].hand
        recording = read_recording(trial.file, manifest.file_scale)
        found = select_markers(recording, manifest, trial)
        columns = [found.hand_labels.index(label) for label in hand.markers]
        if trial.glove is None:
            raise ValueError(f"{trial.name} has no glove")
        angles, _ = select_glove(
            read_glove(trial.glove, manifest.glove), recording, found.times, {truth.side: hand}
        )
        markers = found.hands[truth.side][:, columns]
        trials.append(Worn(truth, hand, markers, recording.rate, angles[truth.side]))
    return trials


def errors_of(trial: Worn, digit: str, rng: np.random.Generator) -> tuple[tuple[Floats, Floats], Floats]:
    """Return the tip's errors without and with the glove, and its standard deviation with it [m]."""
    n, length = len(trial.markers), round(HIDDEN * trial.rate)
    start = int(rng.integers(length // 2, n - length - length // 2))
    hidden = slice(start, start + length)
    markers = trial.markers.copy()
    markers[hidden, [label.startswith(f"{digit}_") for label in trial.hand.markers]] = np.nan
    prior, tracking = default_prior(trial.hand), PARAMETERS.tracking
    alone = track_hand(trial.hand, markers, trial.rate, prior, tracking)
    fit = fit_glove(
        trial.glove,
        trial.hand,
        trial.truth.times,
        alone.q[:, SEVEN:],
        alone.q_sd[:, FREE:],
        PARAMETERS.glove,
    )
    helped = track_hand(trial.hand, markers, trial.rate, prior, tracking, fit.measurement)
    tip = SITES.index(f"{digit}_tip")

    def error(track: HandTrack) -> Floats:
        wrong = track.sites[hidden, tip] - trial.truth.sites[hidden, tip]
        return np.asarray(np.linalg.norm(wrong, axis=1))

    return (error(alone), error(helped)), helped.sites_sd[hidden, tip]
