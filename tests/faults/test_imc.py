"""IMC vehicles on a network as it is at sea, beside others, and vehicles that fail."""

from pathlib import Path

import pytest

from tests.faults.cut import can_be_made
from tests.faults.imc_scenes import bad_radio, cut_in_two, lied_to_over_imc, two_services, vanished

SPEED = 20.0


async def test_a_mission_is_flown_over_a_bad_radio(tmp_path: Path) -> None:
    await bad_radio(tmp_path, steps=4, speed=10.0)


async def test_a_vehicle_that_vanishes_is_told_of_and_taken_back(tmp_path: Path) -> None:
    await vanished(tmp_path, steps=14, speed=SPEED)


async def test_what_a_lying_vehicle_says_moves_nobody_out_of_the_area(tmp_path: Path) -> None:
    await lied_to_over_imc(tmp_path, steps=4, speed=SPEED)


async def test_neither_of_two_services_takes_the_others_vehicle(tmp_path: Path) -> None:
    await two_services(tmp_path, steps=4, speed=SPEED)


@pytest.mark.skipif(not can_be_made(), reason="network namespaces need root and the program ip")
async def test_a_mission_outlasts_a_network_that_is_cut_in_two(tmp_path: Path) -> None:
    await cut_in_two(tmp_path, steps=8, cuts=1, speed=SPEED)
