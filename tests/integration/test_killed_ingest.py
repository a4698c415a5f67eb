"""An ingest killed at any moment leaves a whole database, and a second run completes it."""

import random
from pathlib import Path

import kill_ingest
import pytest

ROUNDS = 6


def test_killed_ingests_are_completed_by_a_second_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kill_ingest, "N_TRIALS", 5)
    bench = kill_ingest.prepare(tmp_path)
    assert len(bench.expected[True]) == 5
    rng = random.Random(1)
    rounds = [kill_ingest.one_round(bench, number, rng) for number in range(ROUNDS)]
    assert [found.faults for found in rounds] == [()] * ROUNDS
