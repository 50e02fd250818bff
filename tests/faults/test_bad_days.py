"""Everything at once, as it comes: what was accepted is kept, nobody leaves the area, and the operator reads why."""

from pathlib import Path

import pytest

from tests.support.faults.disks import small_disk
from tests.support.faults.imc_scenes import bad_day_at_sea
from tests.support.faults.scenes import bad_day


@pytest.mark.slow
async def test_full_disk_lock_clock_and_liar_in_one_mission(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk") as disk:
        await bad_day(tmp_path, disk)


@pytest.mark.slow
async def test_bad_radio_a_liar_and_a_vehicle_that_vanishes_in_one_mission(tmp_path: Path) -> None:
    await bad_day_at_sea(tmp_path, speed=10.0)
