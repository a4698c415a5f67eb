"""A whole simulated session: subjects, objects, trials and their truth, in a folder."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np

from graspdb.simulate.force_panels import write_pressure
from graspdb.simulate.glove import draw_glove, write_glove
from graspdb.simulate.grasps import VARIETY, Grasp
from graspdb.simulate.kinds import PLANS, Plan
from graspdb.simulate.measurement import NoiseParameters
from graspdb.simulate.motion import Motion
from graspdb.simulate.objects import OBJECTS, SimulatedObject, make_inverted_t
from graspdb.simulate.subjects import SimulatedSubject, draw_subject
from graspdb.simulate.trial import attempt, in_object, record
from graspdb.simulate.truth import SessionTruth, TrialTruth, save_session, save_trial
from graspdb.simulate.writer import TrialEntry, write_c3d, write_manifest, write_object
from graspdb_schemas.errors import ParameterError, nearest

Experiment = Literal["objects", "force_panels"]

EXPERIMENTS: Final[tuple[Experiment, ...]] = ("objects", "force_panels")


@dataclass(frozen=True)
class SimulatedSession:
    """What `simulate_session` wrote.

    Attributes
    ----------
    path : Path
        The session's folder.
    trials : tuple of str
        Names of the trials.
    truth : SessionTruth
        What really happened.
    objects : tuple of SimulatedObject
        The objects.
    """

    path: Path
    trials: tuple[str, ...]
    truth: SessionTruth
    objects: tuple[SimulatedObject, ...]


@dataclass(frozen=True)
class Task:
    """One trial that is to be done."""

    body: SimulatedObject
    plan: Plan
    repetition: int


def simulate_session(
    directory: str | Path,
    subjects: int = 3,
    trials: int = 1,
    seed: int = 0,
    experiment: Experiment = "objects",
    noise: NoiseParameters | None = None,
    rate: float = 120.0,
    objects: Iterable[str] | None = None,
    kinds: Iterable[str] | None = None,
    gloves: bool = False,
    proportion_sd: float = 0.0,
    variety: float = VARIETY,
) -> SimulatedSession:
    """Write a session of simulated recordings, and the truth beside it.

    Parameters
    ----------
    directory : str or Path
        Folder to write; it is made, and must be empty.
    subjects : int
        Number of people.
    trials : int
        Trials of each subject, object and kind of grasp.
    seed : int
        Decides everything random: the same seed gives the same files, byte for byte.
    experiment : {'objects', 'force_panels'}
        Bottle, mug and milk jug; or an inverted T with two force panels.
    noise : NoiseParameters, optional
        What the measurement does to the markers.
    rate : float
        Frames per second [Hz].
    objects, kinds : iterable of str, optional
        Names of objects and of kinds of grasp to simulate; all where left out.
    gloves : bool
        Whether the hands wear data gloves.
    proportion_sd : float
        Relative spread of bones' lengths about the proportions that ingest starts from; with zero,
        hands have those very proportions.
    variety : float
        How far people's own ways of grasping are from the plan of a kind, and so from each other, as for
        `find_grasp`. With 1 the hands of two people in a grasp of one kind differ as those of real grasps
        of one place do; unless given they differ less, and kinds are easy to tell apart by posture.

    Returns
    -------
    SimulatedSession
        Where it is, and its truth.

    Raises
    ------
    ParameterError
        If an argument is out of range, a name is unknown, or the folder is not empty.
    NoGraspError
        If a hand cannot grasp an object as planned.
    """
    folder = Path(directory)
    noise = noise if noise is not None else NoiseParameters()
    _check(folder, subjects, trials, seed, experiment, rate)
    if not 0 <= proportion_sd <= 0.1:
        raise ParameterError("proportion_sd", proportion_sd, "0 to 0.1")
    if not 0 <= variety <= 3:
        raise ParameterError("variety", variety, "0 to 3")
    bodies = _draw_objects(experiment, objects, seed)
    tasks = list(_tasks(bodies, kinds, trials))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "trials").mkdir()
    people = [draw_subject(f"s{i + 1}", _generator(seed, 1, i), proportion_sd) for i in range(subjects)]
    truths: dict[str, TrialTruth] = {}
    entries: list[TrialEntry] = []
    for number, subject in enumerate(people):
        worn = _generator(seed, 3, number)
        stream = (seed, 2, number)
        for simulated, true in _subject_trials(folder, subject, tasks, noise, rate, stream, variety):
            entry, truth = _with_glove(folder, simulated, true, noise, worn) if gloves else (simulated, true)
            save_trial(folder, truth)
            entries.append(entry)
            truths[entry.name] = truth
    for body in bodies:
        write_object(folder, body)
    write_manifest(folder, f"simulated-{experiment.replace('_', '-')}-{seed}", people, bodies, entries)
    whole = SessionTruth(seed, experiment, rate, noise, {s.name: s for s in people}, truths)
    save_session(folder, whole)
    return SimulatedSession(folder, tuple(truths), whole, tuple(bodies))


def _subject_trials(
    folder: Path,
    subject: SimulatedSubject,
    tasks: list[Task],
    noise: NoiseParameters,
    rate: float,
    stream: tuple[int, ...],
    variety: float,
) -> Iterator[tuple[TrialEntry, TrialTruth]]:
    """Simulate one subject's trials in a random order, and write them.

    Names and repetitions count trials of an object, whatever the kind of grasp.
    """
    rng = _generator(*stream)
    found: dict[tuple[str, str], Grasp] = {}
    counts: dict[str, int] = {}
    for i in rng.permutation(len(tasks)):
        task = tasks[i]
        body, key = task.body, (task.body.name, task.plan.kind)
        done = attempt(subject, body, task.plan, rng, rate, found.get(key), variety)
        found.setdefault(key, done.grasp)
        counts[body.name] = counts.get(body.name, 0) + 1
        panels = body.name == "inverted_t"
        name = f"{subject.name}_{body.name}_{counts[body.name]:02d}"
        trial = record(name, subject, body, done, task.repetition, noise, rate, rng)
        truth = trial.truth
        write_c3d(folder / "trials" / f"{name}.c3d", truth.marker_labels, trial.measured.positions, rate)
        if panels:
            _write_reference(folder, subject, body, done.motion, truth, noise, rng)
        yield TrialEntry(name, subject.name, body.name, counts[body.name], panels), truth


def _with_glove(
    folder: Path, entry: TrialEntry, truth: TrialTruth, noise: NoiseParameters, rng: np.random.Generator
) -> tuple[TrialEntry, TrialTruth]:
    """Write the glove's angles of a trial; every trial puts the glove on anew."""
    glove = draw_glove(noise, rng)
    write_glove(folder / "gloves" / f"{entry.name}.csv", truth.times, truth.q, glove, noise, rng)
    return replace(entry, glove=True), replace(truth, glove=glove)


def _write_reference(
    folder: Path,
    subject: SimulatedSubject,
    body: SimulatedObject,
    motion: Motion,
    truth: TrialTruth,
    noise: NoiseParameters,
    rng: np.random.Generator,
) -> None:
    digits = tuple(truth.kind.split("_"))
    sites = in_object(motion, truth.sites)
    path = folder / "reference" / f"{truth.trial}.csv"
    write_pressure(path, digits, body.surface, sites, subject.dimensions.radii, truth, noise, rng)


def _generator(*stream: int) -> np.random.Generator:
    return np.random.default_rng(list(stream))


def _draw_objects(experiment: str, names: Iterable[str] | None, seed: int) -> list[SimulatedObject]:
    makers = OBJECTS if experiment == "objects" else {"inverted_t": make_inverted_t}
    wanted = _chosen("objects", names, tuple(makers))
    return [make(_generator(seed, 0, i)) for i, (name, make) in enumerate(makers.items()) if name in wanted]


def _tasks(bodies: list[SimulatedObject], kinds: Iterable[str] | None, trials: int) -> Iterator[Task]:
    plans = [(body, plan) for body in bodies for plan in PLANS[body.name](body.measures)]
    wanted = _chosen("kinds", kinds, tuple(dict.fromkeys(plan.kind for _, plan in plans)))
    for body, plan in plans:
        if plan.kind in wanted:
            for repetition in range(1, trials + 1):
                yield Task(body, plan, repetition)


def _chosen(name: str, chosen: Iterable[str] | None, allowed: tuple[str, ...]) -> tuple[str, ...]:
    wanted = allowed if chosen is None else tuple(chosen)
    for value in wanted:
        if value not in allowed:
            raise ParameterError(name, value, f"some of {', '.join(allowed)}{nearest(value, allowed)}")
    if not wanted:
        raise ParameterError(name, wanted, f"some of {', '.join(allowed)}")
    return wanted


def _check(folder: Path, subjects: int, trials: int, seed: int, experiment: str, rate: float) -> None:
    if experiment not in EXPERIMENTS:
        raise ParameterError("experiment", experiment, f"one of {', '.join(EXPERIMENTS)}")
    for name, value in (("subjects", subjects), ("trials", trials)):
        if value < 1:
            raise ParameterError(name, value, "1 or more")
    if seed < 0:
        raise ParameterError("seed", seed, "0 or more")
    if not 20 <= rate <= 2000:
        raise ParameterError("rate", rate, "20 to 2000 Hz")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ParameterError("directory", str(folder), "a folder that is empty or not there yet")
