"""The database cannot be written for a while: the fleet waits, everyone is told why, and nothing is lost."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.faults.disks import Disk, Ration, small_disk
from tests.faults.scenes import aborted_without_a_disk, disk_full, locked


@pytest.fixture(params=["disk", "ration"])
def disk(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Disk]:
    folder = tmp_path / "disk"
    if request.param == "ration":
        folder.mkdir()
        yield Ration(folder)
        return
    with small_disk(folder) as disk:
        yield disk


async def test_a_mission_waits_for_room_on_the_disk(tmp_path: Path, disk: Disk) -> None:
    await disk_full(tmp_path, disk, steps=8, fills=1)


async def test_an_abort_stops_the_fleet_though_it_cannot_be_written(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk") as disk:
        await aborted_without_a_disk(tmp_path, disk)


async def test_a_mission_waits_for_whoever_holds_the_database(tmp_path: Path) -> None:
    await locked(tmp_path, steps=8, locks=1, busy_ms=200)
