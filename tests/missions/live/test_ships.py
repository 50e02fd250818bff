"""Which ships come close to which vehicles, by where these are and where they will be."""

import asyncio
from typing import Any

import numpy as np
import pytest

from app.missions.fleet.interface import Position, VehicleReport, WaypointOrder, WaypointStatus
from app.missions.live.ships import RELEASE, ShipsAbout
from app.missions.settings import AisSettings
from app.missions.spec.failsafes import Response
from app.missions.spec.vehicle import VehicleSpec
from app.missions.team import CommittedLeg, Member, Team, Withdrawal
from app.missions.traffic.sentences import ShipParticulars, ShipPosition
from app.missions.traffic.watch import Traffic
from tests.support.missions.specs import FRAME, make_spec

MMSI = 211000001


def place(east_m: float, north_m: float, depth_m: float = 0.0) -> Position:
    lat, lon = FRAME.to_geographic(east_m, north_m)
    return Position(float(lat), float(lon), depth_m)


class Sea:
    """A vehicle at a depth, and ships."""

    def __init__(self, depth_m: float, **ais: Any) -> None:
        self.traffic = Traffic(AisSettings.model_validate({"udp_port": 0, "cpa_m": 100.0} | ais))
        spec = make_spec(vehicles=[{"name": "a", "kind": "sim"}])
        self.team = Team()
        self.member = self.team.join(VehicleSpec.model_validate({"name": "a", "kind": "sim"}), 0)
        self.member.report = VehicleReport("a", 0.0, place(0.0, 0.0, depth_m))
        self.about = ShipsAbout("m1", lambda: spec, spec.frame(), self.team, 1.0)
        self.about.traffic = self.traffic
        self.speed_mps = spec.speed_of(self.member.spec)

    def ship(self, east_m: float, north_m: float, mps: float = 0.0, course_deg: float = 0.0, mmsi: int = MMSI) -> None:
        at = place(east_m, north_m)
        told = ShipPosition(mmsi, False, at.lat_deg, at.lon_deg, mps, course_deg)
        assert self.traffic.ship_list.place(told, asyncio.get_running_loop().time())

    def order(self, east_m: float, depth_m: float) -> None:
        self.member.set_order(
            WaypointOrder("m1", 1, "a", place(east_m, 0.0, depth_m), self.speed_mps, 3.0, 2.0), np.array([east_m, 0.0])
        )
        self.member.status = WaypointStatus.PLANNED

    def close(self, *begun: int) -> list[float]:
        return [one.distance_m for one in self.about.encounters(self.member, begun)]


async def test_a_ship_that_passes_close_to_a_vehicle_at_the_surface_is_told() -> None:
    sea = Sea(0.0)
    sea.ship(-500.0, 50.0, mps=5.0, course_deg=90.0)
    [one] = sea.about.encounters(sea.member, ())
    assert one.distance_m == pytest.approx(50.0, abs=0.5)
    assert one.in_s == pytest.approx(100.0, abs=1.0)
    assert one.words == f"the ship MMSI {MMSI} comes to 50 m in 100 s"


@pytest.mark.parametrize(
    ("north_m", "mps", "course_deg"),
    [(150.0, 5.0, 90.0), (50.0, 5.0, 270.0), (50.0, 1.0, 90.0)],
)
async def test_a_ship_that_passes_far_off_or_goes_away_or_comes_late_is_not(
    north_m: float, mps: float, course_deg: float
) -> None:
    sea = Sea(0.0)
    sea.ship(-500.0, north_m, mps, course_deg)
    assert sea.close() == []


async def test_a_deep_vehicle_is_out_of_ships_way_unless_it_comes_up_or_the_ship_draws_more() -> None:
    sea = Sea(8.0)
    sea.ship(0.0, 0.0)
    assert sea.close() == []
    sea.order(20.0, 8.0)
    assert sea.close() == []
    sea.member.ahead.append(CommittedLeg(2, place(40.0, 0.0, 0.0), np.array([40.0, 0.0])))
    assert len(sea.close()) == 1, "its next leg leads up"
    sea.member.ahead.clear()
    sea.traffic.ship_list.describe(ShipParticulars(MMSI, False, draught_m=12.0))
    assert len(sea.close()) == 1, "it draws more than the vehicle is deep"


async def test_a_vehicle_that_waits_below_would_come_up_where_it_is() -> None:
    sea = Sea(8.0)
    sea.ship(0.0, 0.0)
    sea.member.withdrawal = Withdrawal(Response.HOLD, "ships", below=True)
    assert len(sea.close()) == 1


async def test_the_hull_is_nearer_than_the_aerial() -> None:
    sea = Sea(0.0)
    sea.ship(0.0, 150.0)
    assert sea.close() == []
    sea.traffic.ship_list.describe(ShipParticulars(MMSI, False, to_bow_m=60.0, to_stern_m=10.0))
    assert sea.close() == pytest.approx([90.0], abs=0.5)


async def test_an_alarm_needs_more_room_to_be_over_than_to_begin() -> None:
    sea = Sea(0.0)
    sea.ship(0.0, 110.0)
    assert sea.close() == []
    assert sea.close(MMSI) == pytest.approx([110.0], abs=0.5)
    sea.ship(0.0, RELEASE * 100.0 + 5.0)
    assert sea.close(MMSI) == []


async def test_own_ships_are_shown_without_an_alarm() -> None:
    sea = Sea(0.0, own_mmsi=[MMSI])
    sea.ship(0.0, 50.0)
    assert sea.close() == []
    [view] = sea.about.views()
    assert view.own
    assert view.closest is not None
    assert not view.closest.alarm


async def test_views_name_the_nearest_vehicle() -> None:
    sea = Sea(0.0)
    other = sea.team.join(VehicleSpec.model_validate({"name": "b", "kind": "sim"}), 1)
    other.report = VehicleReport("b", 0.0, place(0.0, 60.0))
    sea.ship(0.0, 100.0)
    [view] = sea.about.views()
    assert view.closest is not None
    assert (view.closest.vehicle, view.closest.alarm) == ("b", True)
    assert view.closest.distance_m == pytest.approx(40.0, abs=0.5)


async def test_a_thousand_ships_are_looked_at_and_the_nearest_shown() -> None:
    sea = Sea(0.0)
    for number in range(1000):
        sea.ship(10.0 * number, 0.0, mmsi=MMSI + number)
    assert len(sea.close()) == 11
    shown = sea.about.views()
    assert len(shown) == 300


def test_without_a_receiver_there_are_no_ships() -> None:
    sea = Sea(0.0)
    sea.about.traffic = None
    assert not sea.about.listens
    assert sea.about.views() == []
    assert isinstance(sea.member, Member)
    assert sea.close() == []
