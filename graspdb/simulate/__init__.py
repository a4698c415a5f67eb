"""Simulated recordings of grasping with known truth: the paper's two experiments."""

from graspdb.simulate.measurement import NoiseParameters
from graspdb.simulate.session import SimulatedSession, simulate_session
from graspdb.simulate.truth import SessionTruth, TrialTruth, load_truth

__all__ = [
    "NoiseParameters",
    "SessionTruth",
    "SimulatedSession",
    "TrialTruth",
    "load_truth",
    "simulate_session",
]
