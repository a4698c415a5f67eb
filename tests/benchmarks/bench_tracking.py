"""How near the tracker comes to the truth, whether its standard deviations are right, and how fast it is."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import process_time

import numpy as np
from harness import Result, benchmark
from scipy.stats import chi2
from threadpoolctl import threadpool_limits

from graspdb.simulate.measurement import NoiseParameters, measure
from graspdb.simulate.session import simulate_session
from graspdb.simulate.truth import TrialTruth, load_truth
from graspdb_ingest.hand import HandModel
from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.following import follow, make_follower
from graspdb_ingest.tracking.motion import MotionNoise, motion_model
from graspdb_ingest.tracking.noise import estimate_noise
from graspdb_ingest.tracking.smoother import ForwardPass
from graspdb_ingest.tracking.tracker import HandTrack, track_hand
from graspdb_schemas.vocabulary import DIGITS, TIPS

RATE, SEED = 120.0, 11
NOISE = NoiseParameters(marker_sd=0.001, skin_sd=0, occlusion=0.2, occlusion_burst=(0.05, 0.5))
PARAMETERS = TrackingParameters()
INDEPENDENT = 0.5
"""Time after which errors of the track are independent of each other [s]."""
GROUPS = {"free joint": slice(0, 6), "wrist": slice(6, 8), "digits": slice(8, 29), "all": slice(0, 29)}


@dataclass(frozen=True)
class Recorded:
    """A simulated trial with the true hand, its true movement, and its markers as recorded."""

    hand: HandModel
    truth: TrialTruth
    markers: Floats
    noise: MotionNoise

    def track(self, markers: Floats) -> HandTrack:
        """Follow the true hand."""
        prior = default_prior(self.hand)
        return track_hand(self.hand, markers, RATE, prior, PARAMETERS, noise=self.noise)


@cache
def recordings() -> tuple[Recorded, ...]:
    """Return every trial of two people, the scales of movement estimated from each one's first six."""
    with tempfile.TemporaryDirectory() as folder:
        session = Path(folder) / "session"
        simulate_session(session, subjects=2, seed=SEED, noise=NoiseParameters.none(), rate=RATE)
        truth = load_truth(session)
    rng, found = np.random.default_rng(SEED), []
    for name, subject in truth.subjects.items():
        trials = [t for t in truth.trials.values() if t.subject == name]
        columns = subject.marker_columns()
        markers = []
        for trial in trials:
            true = trial.markers[:, : len(columns)].astype(float)
            recorded = measure(true, trial.marker_labels[: len(columns)], NOISE, RATE, rng).positions
            markers.append(np.empty_like(recorded))
            markers[-1][:, columns] = recorded
        first = [(m, RATE) for m in markers[:6]]
        noise = estimate_noise(subject.hand, first, default_prior(subject.hand), PARAMETERS)
        found += [Recorded(subject.hand, t, m, noise) for t, m in zip(trials, markers, strict=True)]
    return tuple(found)


@benchmark("tracking")
def tracking() -> Sequence[Result]:
    """Follow the true hand through recordings with noise and gaps."""
    with threadpool_limits(1):
        tracks = [recorded.track(recorded.markers) for recorded in recordings()]
    errors = [
        np.linalg.norm(t.sites - r.truth.sites, axis=2) for t, r in zip(tracks, recordings(), strict=True)
    ]
    together = np.concatenate(errors)
    said = np.concatenate([track.sites_sd for track in tracks])
    setting = "simulated, true hand, 1 mm noise, 20 % missing"
    return [
        Result(
            "error of the tips",
            1e3 * together[:, list(TIPS)].mean(),
            None,
            "mm",
            note=f"{setting}; at most 0.7",
        ),
        Result("error of the 20 sites", 1e3 * together.mean(), None, "mm", note=f"{setting}; at most 0.6"),
        Result(
            "sites within two standard deviations", (together < 2 * said).mean(), None, "1", "more", setting
        ),
        *consistency(tracks),
    ]


def consistency(tracks: Sequence[HandTrack]) -> Iterator[Result]:
    """Yield squared errors over their variances, of frames far enough apart to be independent."""
    thinned = round(INDEPENDENT * RATE)
    squared = []
    for track, recorded in zip(tracks, recordings(), strict=True):
        for i in range(thinned // 2, len(track.q), thinned):
            error = recorded.hand.difference(track.q[i], recorded.truth.q[i])
            squared.append((error / track.q_sd[i]) ** 2)
    for group, dofs in GROUPS.items():
        chosen = np.array(squared)[:, dofs]
        low, high = (float(chi2.ppf(p, chosen.size)) / chosen.size for p in (0.025, 0.975))
        note = f"95 % bounds {low:.3f} to {high:.3f} for {len(squared)} frames {INDEPENDENT} s apart"
        yield Result(f"normalised squared error, {group}", chosen.mean(), None, "1", note=note)


@benchmark("hidden digit")
def hidden_digit() -> Sequence[Result]:
    """Hide all markers of one digit for a second."""
    rng = np.random.default_rng(SEED)
    errors: list[Floats] = []
    said: list[Floats] = []
    with threadpool_limits(1):
        for number, recorded in enumerate(recordings()):
            digit = number % len(DIGITS)
            hidden = [i for i, m in enumerate(recorded.hand.markers) if m.startswith(DIGITS[digit])]
            first = int(rng.integers(60, len(recorded.markers) - 180))
            frames, markers = slice(first, first + round(RATE)), recorded.markers.copy()
            markers[frames, hidden] = np.nan
            track, tip = recorded.track(markers), TIPS[digit]
            errors.append(np.linalg.norm(track.sites - recorded.truth.sites, axis=2)[frames, tip])
            said.append(track.sites_sd[frames, tip])
    error = np.concatenate(errors)
    share = float((error < 2 * np.concatenate(said)).mean())
    note = "all markers of one digit hidden for 1 s, no glove"
    return [
        Result("tip of a hidden digit", 1e3 * error.mean(), None, "mm", note=note),
        Result("hidden tip within two sd", share, None, "1", "more", note=f"{note}; at least 0.93"),
    ]


@benchmark("tracking speed")
def tracking_speed() -> Sequence[Result]:
    """Time the filter forward and backward, and all that `track_hand` does."""
    recorded = recordings()[0]
    markers, prior = recorded.markers, default_prior(recorded.hand)
    kinematics = Kinematics(recorded.hand)
    motion = motion_model(recorded.hand, prior, recorded.noise, 1 / RATE)
    forward = ForwardPass(len(markers), recorded.hand.n_dof, len(recorded.hand.markers))

    def once() -> None:
        follower = make_follower(kinematics, motion, prior, PARAMETERS, RATE, recorded.noise)
        for stretch in follow(follower, markers, None, forward):
            for _ in stretch.forward.smooth(motion):
                pass

    with threadpool_limits(1):
        both = min(_seconds(once) for _ in range(5))
        whole = min(_seconds(lambda: recorded.track(markers)) for _ in range(2))
    note = f"CPU time on one core, {len(markers)} frames of 24 markers"
    return [
        Result(
            "forward and backward", len(markers) / both, None, "frames/s", "more", f"{note}; at least 5,000"
        ),
        Result(
            "track_hand", len(markers) / whole, None, "frames/s", "more", f"{note}: start, passes, faults"
        ),
    ]


def _seconds(work: Callable[[], object]) -> float:
    """Return the CPU time of a call [s]."""
    start = process_time()
    work()
    return process_time() - start
