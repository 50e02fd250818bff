"""Vehicles that say what cannot be."""

from pathlib import Path

from tests.faults.scenes import lied_to


async def test_what_a_lying_vehicle_posts_is_refused_with_the_reason(tmp_path: Path) -> None:
    await lied_to(tmp_path, steps=6)
