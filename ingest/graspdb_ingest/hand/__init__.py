"""The hand: its dimensions, its MuJoCo model, and where joints usually are."""

from graspdb_ingest.hand.dimensions import HandDimensions
from graspdb_ingest.hand.mjcf import build_hand
from graspdb_ingest.hand.model import HandModel, HandPose

__all__ = ["HandDimensions", "HandModel", "HandPose", "build_hand"]
