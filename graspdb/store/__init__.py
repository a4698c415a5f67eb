"""The store: atomic commits of trials to Delta Lake tables, and consistent snapshots of them."""

from graspdb.store.commit import Committed, Outcome
from graspdb.store.snapshot import Snapshot, take_snapshot
from graspdb.store.store import Store

__all__ = ["Committed", "Outcome", "Snapshot", "Store", "take_snapshot"]
