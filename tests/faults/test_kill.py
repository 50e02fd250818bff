"""kill -9 at any moment: the mission goes on from its last committed step, and nothing that was accepted is lost."""

from pathlib import Path

import pytest

from tests.support.faults.scenes import killed_again_and_again

KILLS, STEPS = 3, 30
"""The long version is ``benchmarks/service/faults.py``."""


@pytest.mark.slow
@pytest.mark.timeout(900)
async def test_a_mission_survives_being_killed_at_random_moments(tmp_path: Path) -> None:
    await killed_again_and_again(tmp_path, kills=KILLS, steps=STEPS, seed=2026)
