"""Each scene by itself, short; minutes, so only where ``BATHYFLEET_FAULTS`` is set. See ``test_bad_days.py``."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.faults.cut import can_be_made
from tests.support.faults.disks import Disk, Ration, small_disk
from tests.support.faults.imc_scenes import bad_radio, cut_in_two, lied_to_over_imc, two_services, vanished
from tests.support.faults.left_alone import left_alone
from tests.support.faults.scenes import aborted_without_a_disk, clock_jumps, disk_full, lied_to, locked

pytestmark = pytest.mark.skipif("BATHYFLEET_FAULTS" not in os.environ, reason="set BATHYFLEET_FAULTS to play them all")
SPEED = 20.0


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
    await disk_full(tmp_path, disk, steps=20, fills=1)


async def test_an_abort_stops_the_fleet_though_it_cannot_be_written(tmp_path: Path, disk: Disk) -> None:
    await aborted_without_a_disk(tmp_path, disk)


async def test_a_mission_waits_for_whoever_holds_the_database(tmp_path: Path) -> None:
    await locked(tmp_path, steps=20, locks=1, busy_ms=200)


async def test_a_clock_that_is_set_forward_and_back_is_told_of_and_changes_nothing(tmp_path: Path) -> None:
    await clock_jumps(tmp_path, [86_400.0, -172_800.0])


async def test_what_a_lying_vehicle_posts_is_refused_with_the_reason(tmp_path: Path) -> None:
    await lied_to(tmp_path, steps=6)


async def test_a_mission_is_flown_over_a_bad_radio(tmp_path: Path) -> None:
    await bad_radio(tmp_path, steps=4, speed=10.0)


async def test_a_vehicle_that_vanishes_is_told_of_and_taken_back(tmp_path: Path) -> None:
    await vanished(tmp_path, steps=14, speed=SPEED)


async def test_what_a_lying_vehicle_says_moves_nobody_out_of_the_area(tmp_path: Path) -> None:
    await lied_to_over_imc(tmp_path, steps=4, speed=SPEED)


async def test_neither_of_two_services_takes_the_others_vehicle(tmp_path: Path) -> None:
    await two_services(tmp_path, steps=4, speed=SPEED)


async def test_vehicles_that_are_left_alone_come_home(tmp_path: Path) -> None:
    found = await left_alone(tmp_path, seed=1, speed=SPEED, timeout_s=60.0)
    assert found["home"] == 2, found
    assert (found["zones_entered"], found["too_close"]) == (0, 0), found


@pytest.mark.skipif(not can_be_made(), reason="network namespaces need root and the program ip")
async def test_a_mission_outlasts_a_network_that_is_cut_in_two(tmp_path: Path) -> None:
    await cut_in_two(tmp_path, steps=8, cuts=1, speed=SPEED)
