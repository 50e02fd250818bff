"""One contract, three links: IMC over real UDP with fake DUNE nodes, vehicles that poll, vehicles in this process."""

import asyncio
import contextlib
import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable

import numpy as np
import pytest

from app.mapping.coordinates.distances import horizontal_distance_m
from app.missions import clock
from app.missions.fleet.interface import (
    FleetEvent,
    FleetLink,
    LinkReport,
    LinkState,
    Position,
    SoundingReport,
    VehicleInfo,
    VehicleRefusedError,
    VehicleReport,
    WaypointOrder,
    WaypointReport,
    WaypointStatus,
)
from app.missions.fleet.links.imc import ImcFleetLink
from app.missions.fleet.links.rest import RestFleetLink
from app.missions.fleet.links.sim import SimFleetLink
from app.missions.fleet.links.simulated.launch import FloorPatch, Launch
from app.missions.settings import SimulationSettings
from app.missions.spec.vehicle import Sensor
from imc_bridge import BridgeSettings
from imc_bridge.control.plans import leg_time_s
from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.dune.plan import PlanState
from simulator.floors import seafloors
from simulator.floors.terrain import Terrain
from tests.support.missions.specs import LAT, LON
from tests.support.ports import free_ports
from tests.support.waiting import until

SPEED = 20.0
MISSION = "m1"
ARRIVAL_M = 4.0
FLOOR = seafloors.generate("harbour", 0, origin=(LAT, LON))
S, A, R = WaypointStatus.SENT, WaypointStatus.ACKNOWLEDGED, WaypointStatus.REACHED


class Bench(ABC):
    """A link with one vehicle at its other end, over ``FLOOR``."""

    name: str
    link: FleetLink

    def __init__(self) -> None:
        self.events: list[FleetEvent] = []

    @abstractmethod
    async def launch(self) -> None:
        """Start both ends."""

    @abstractmethod
    async def land(self) -> None:
        """Take the vehicle away; the link is closed already."""

    async def fall_silent(self) -> None:
        """Let the vehicle hear and say nothing more."""
        raise NotImplementedError

    @abstractmethod
    def follows(self) -> bool:
        """Whether the vehicle itself still goes where it was sent."""

    async def give(self, order: WaypointOrder) -> None:
        await self.link.order(order)

    def order(self, step: int, east_m: float, north_m: float, depth_m: float = 1.5) -> WaypointOrder:
        lat, lon = FLOOR.frame.to_geodetic(east_m, north_m)
        return WaypointOrder(MISSION, step, self.name, Position(lat, lon, depth_m), 1.3, ARRIVAL_M, 1.0)

    def info(self) -> VehicleInfo:
        return next(info for info in self.link.vehicles() if info.name == self.name)

    def state(self) -> LinkState | None:
        return next((info.state for info in self.link.vehicles() if info.name == self.name), None)

    def statuses(self, step: int) -> list[WaypointStatus]:
        return [e.status for e in self.events if isinstance(e, WaypointReport) and e.step == step]

    def states(self) -> list[LinkState]:
        return [e.state for e in self.events if isinstance(e, LinkReport)]

    async def reached(self, step: int) -> None:
        await until(lambda: R in self.statuses(step), f"step {step} is reached")


class ImcBench(Bench):
    name = "lauv-sim-1"

    async def launch(self) -> None:
        *announce_ports, port, vehicle_port = free_ports(5)
        self.link = ImcFleetLink(
            BridgeSettings(port=port, loopback_only=True, announce_ports=tuple(announce_ports), time_scale=SPEED)
        )
        self.fleet = DuneFleet(
            FLOOR,
            default_specs(1, FLOOR, base_port=vehicle_port),
            speed=SPEED,
            options=DuneOptions(announce_ports=tuple(announce_ports)),
        )
        await self.fleet.start()
        await self.link.start(self.events.append)

    async def land(self) -> None:
        await self.fleet.stop()

    async def fall_silent(self) -> None:
        await self.fleet.stop()

    def follows(self) -> bool:
        return self.fleet.nodes[0].plan.plan_state is PlanState.EXECUTING


class SimBench(Bench):
    name = "s"

    async def launch(self) -> None:
        link = SimFleetLink(SimulationSettings(), SPEED)
        self.link = link
        await link.start(self.events.append)
        link.launch(
            Launch(
                self.name,
                "m",
                Sensor.SINGLE_BEAM,
                FloorPatch((LAT, LON), 100, 100),
                start=FLOOR.frame.to_geodetic(50, 5),
                noise=0.005,
            )
        )

    async def land(self) -> None:
        """It went with the link."""

    def follows(self) -> bool:
        return self.link._deployed[self.name].order is not None  # type: ignore[attr-defined]


class RestBench(Bench):
    """The vehicle's requests are calls of what the service calls when a request comes in."""

    name = "r"

    async def launch(self) -> None:
        self.rest = RestFleetLink(lost_after_s=300.0)
        self.link = self.rest
        self._laid_out: WaypointOrder | None = None
        self._goal: WaypointOrder | None = None
        self._place = np.array([50.0, 5.0])
        self._time_s = 1_795_225_140.0
        await self.rest.start(self.events.append)
        self._task = asyncio.create_task(self._sail())

    async def give(self, order: WaypointOrder) -> None:
        await self.rest.order(order)
        self._laid_out = order

    async def land(self) -> None:
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    async def fall_silent(self) -> None:
        await self.land()

    def follows(self) -> bool:
        return self._goal is not None

    async def _sail(self) -> None:
        while True:
            self._post()
            self._poll()
            await asyncio.sleep(0.01)

    def _post(self) -> None:
        if self._goal is not None:
            goal = np.array(FLOOR.frame.to_local(self._goal.position.lat_deg, self._goal.position.lon_deg))
            way = goal - self._place
            self._place += way * min(1.0, 0.5 / max(float(np.linalg.norm(way)), 1e-9))
        self._time_s += 0.5
        lat, lon = FLOOR.frame.to_geodetic(*self._place)
        self.rest.heard(VehicleReport(self.name, self._time_s, Position(lat, lon, 1.5)))

    def _poll(self) -> None:
        if self.state() is not LinkState.ENGAGED:
            self._goal = None
            self.rest.told_to_stop(self.name, MISSION)
        elif self._laid_out is not None:
            self._goal = self._laid_out
            self.rest.has_waypoint(self.name, self._goal.step)


BENCHES: dict[str, Callable[[], Bench]] = {"imc": ImcBench, "rest": RestBench, "sim": SimBench}


@contextlib.asynccontextmanager
async def opened(bench: Bench) -> AsyncIterator[Bench]:
    try:
        await bench.launch()
        await until(lambda: bench.state() is LinkState.READY, "the vehicle is ready")
        yield bench
    finally:
        await bench.link.close()
        await bench.land()


@pytest.fixture(params=sorted(BENCHES))
async def bench(request: pytest.FixtureRequest) -> AsyncIterator[Bench]:
    async with opened(BENCHES[request.param]()) as bench:
        yield bench


def distance_m(bench: Bench, order: WaypointOrder) -> float:
    report = bench.info().report
    assert report is not None
    return horizontal_distance_m(report.position.lat_lon, order.position.lat_lon)


async def test_a_vehicle_never_heard_of_is_refused_with_reason_and_remedy(bench: Bench) -> None:
    with pytest.raises(VehicleRefusedError) as caught:
        await bench.link.engage("nobody")
    assert caught.value.vehicle == "nobody"
    assert caught.value.reason
    assert caught.value.remedy
    nowhere = bench.order(1, 50, 20)
    with pytest.raises(VehicleRefusedError) as caught:
        await bench.link.order(WaypointOrder(MISSION, 1, "nobody", nowhere.position, 1.3, 3.0, 1.0))
    assert caught.value.remedy
    assert (await bench.link.stop("nobody", timeout_s=0.5)).vehicle == "nobody"


async def test_an_order_before_engaging_is_refused(bench: Bench) -> None:
    with pytest.raises(VehicleRefusedError) as caught:
        await bench.link.order(bench.order(1, 50, 20))
    assert caught.value.reason
    assert caught.value.remedy
    assert bench.statuses(1) == []


async def test_known_vehicles_are_of_the_links_kind(bench: Bench) -> None:
    assert [(info.name, info.kind) for info in bench.link.vehicles()] == [(bench.name, bench.link.kind)]
    by_name = bench.link.vehicle(bench.name)
    assert by_name is not None
    assert (by_name.name, by_name.kind) == (bench.name, bench.link.kind)
    assert bench.link.vehicle("nobody") is None
    age_s = bench.info().age_s
    assert age_s is not None
    assert age_s >= 0.0


async def test_from_engaging_to_arrival(bench: Bench) -> None:
    await bench.link.engage(bench.name)
    assert bench.state() is LinkState.ENGAGED
    await until(lambda: LinkState.ENGAGED in bench.states(), "the link reports that it is engaged")
    await bench.link.engage(bench.name)  # again is harmless
    assert bench.state() is LinkState.ENGAGED
    order = bench.order(1, 50, 25)
    await bench.give(order)
    await bench.reached(1)
    assert bench.statuses(1) == [S, A, R]
    assert all(
        e.mission_id == MISSION and e.vehicle == bench.name for e in bench.events if isinstance(e, WaypointReport)
    )
    assert distance_m(bench, order) <= ARRIVAL_M + 2.0
    times = [e.time_s for e in bench.events if isinstance(e, VehicleReport)]
    assert times == sorted(times)
    assert len(times) > 3


async def test_a_repeated_order_is_harmless(bench: Bench) -> None:
    await bench.link.engage(bench.name)
    order = bench.order(1, 50, 25)
    await bench.give(order)
    await bench.give(order)
    await bench.reached(1)
    await bench.give(order)
    await until(lambda: bench.statuses(1)[-1] is R, "it is reached after all")
    assert set(bench.statuses(1)) == {S, A, R}
    assert bench.state() is LinkState.ENGAGED
    assert distance_m(bench, order) <= ARRIVAL_M + 2.0
    await bench.give(bench.order(2, 50, 35))
    await bench.reached(2)


async def test_a_new_order_replaces_the_old(bench: Bench) -> None:
    await bench.link.engage(bench.name)
    await bench.give(bench.order(1, 50, 95))
    await until(lambda: A in bench.statuses(1), "the first is acknowledged")
    order = bench.order(2, 60, 20)
    await bench.give(order)
    await bench.reached(2)
    assert R not in bench.statuses(1)
    assert bench.statuses(2) == [S, A, R]
    # DUNE circles where it arrived, by up to 10 m from it.
    assert distance_m(bench, order) <= ARRIVAL_M + 10.0


async def test_a_second_place_to_wait_replaces_the_first(bench: Bench) -> None:
    """Waits are no legs: all of them have the same number."""
    await bench.link.engage(bench.name)
    await bench.give(bench.order(0, 50, 95))
    await until(lambda: A in bench.statuses(0), "it is on its way to the first")
    second = bench.order(0, 60, 20)
    await bench.give(second)
    await until(lambda: R in bench.statuses(0), "it is where it is to wait")
    # DUNE circles where it arrived, by up to 10 m from it.
    assert distance_m(bench, second) <= ARRIVAL_M + 10.0


async def test_a_stop_is_acknowledged_and_can_be_repeated(bench: Bench) -> None:
    assert (await bench.link.stop(bench.name)).vehicle == bench.name  # before anything
    await bench.link.engage(bench.name)
    await bench.give(bench.order(1, 50, 95))
    await until(lambda: A in bench.statuses(1), "it is under way")
    receipt = await bench.link.stop(bench.name, timeout_s=20.0)
    assert (receipt.vehicle, receipt.acknowledged) == (bench.name, True)
    assert receipt.detail
    await until(lambda: not bench.follows(), "the vehicle itself has stopped")
    await until(lambda: bench.state() is LinkState.READY, "it is ready again")
    assert bench.states()[-1] is LinkState.READY
    assert (await bench.link.stop(bench.name, timeout_s=20.0)).acknowledged
    with pytest.raises(VehicleRefusedError) as caught:
        await bench.link.order(bench.order(2, 50, 20))
    assert caught.value.remedy
    assert R not in bench.statuses(1)


async def test_after_a_stop_it_can_be_engaged_again(bench: Bench) -> None:
    await bench.link.engage(bench.name)
    await bench.give(bench.order(1, 50, 60))
    assert (await bench.link.stop(bench.name, timeout_s=20.0)).acknowledged
    await until(lambda: bench.state() is LinkState.READY, "it is ready again")
    await bench.link.engage(bench.name)
    await bench.give(bench.order(2, 50, 20))
    await bench.reached(2)


@pytest.mark.parametrize("make", [ImcBench, RestBench])
async def test_a_stop_of_a_silent_vehicle_comes_back_without_acknowledgement(make: type[Bench]) -> None:
    async with opened(make()) as bench:
        await bench.link.engage(bench.name)
        await bench.give(bench.order(1, 50, 95))
        await bench.fall_silent()
        async with asyncio.timeout(60):
            receipt = await bench.link.stop(bench.name, timeout_s=0.5)
            again = await bench.link.stop(bench.name, timeout_s=0.5)
        assert (receipt.vehicle, receipt.acknowledged) == (bench.name, False)
        assert receipt.detail
        assert again.vehicle == bench.name
        with pytest.raises(VehicleRefusedError):
            await bench.link.order(bench.order(2, 50, 20))


async def test_closing_stops_an_engaged_vehicle(bench: Bench) -> None:
    await bench.link.engage(bench.name)
    await bench.give(bench.order(1, 50, 95))
    await until(lambda: A in bench.statuses(1), "it is under way")
    assert bench.follows()
    await bench.link.close()
    await until(lambda: not bench.follows(), "the vehicle itself has stopped")
    assert R not in bench.statuses(1)


@pytest.mark.parametrize("make", [ImcBench, SimBench])
async def test_soundings_tell_the_true_depth(make: type[Bench]) -> None:
    async with opened(make()) as bench:
        terrain: Terrain = FLOOR
        if isinstance(bench, SimBench):
            terrain = bench.link._deployed[bench.name].terrain  # type: ignore[attr-defined]
        await bench.link.engage(bench.name)
        await bench.give(bench.order(1, 50, 30))
        await bench.reached(1)
        soundings = [e for e in bench.events if isinstance(e, SoundingReport)]
    assert len(soundings) > 20
    assert {s.vehicle for s in soundings} == {bench.name}
    assert len({(s.time_s, s.beam) for s in soundings}) == len(soundings)
    errors = []
    for sounding in soundings:
        place = sounding.footprint
        assert place.depth_m == pytest.approx(sounding.vehicle_depth_m + sounding.range_m, abs=0.5)
        errors.append(place.depth_m - terrain.depth_at_point(*terrain.frame.to_local(place.lat_deg, place.lon_deg)))
    errors = [error for error in errors if math.isfinite(error)]
    assert len(errors) > 20
    assert abs(np.mean(errors)) < 0.1
    assert np.median(np.abs(errors)) < 0.2


# What only a link that waits to be asked can get wrong


async def test_a_polling_vehicle_that_is_silent_too_long_counts_as_lost_and_comes_back() -> None:
    link = RestFleetLink(lost_after_s=0.2)
    events: list[FleetEvent] = []
    await link.start(events.append)
    report = VehicleReport("r", 1.0, Position(LAT, LON, 1.0))
    link.heard(report)
    await link.engage("r")
    await until(lambda: link.vehicles()[0].state is LinkState.LOST, "it is lost")
    lost = next(e for e in events if isinstance(e, LinkReport) and e.state is LinkState.LOST)
    assert "silent for more than 0.2 s" in lost.reason
    with pytest.raises(VehicleRefusedError, match="silent"):
        await link.engage("r")
    with pytest.raises(VehicleRefusedError):
        await link.order(WaypointOrder(MISSION, 1, "r", report.position, 1.0, 3.0, 1.0))
    link.heard(report)
    assert link.vehicles()[0].state is LinkState.READY
    await link.engage("r")
    await link.close()


async def test_a_position_of_before_moves_nobody_back_unless_the_clock_was_set_back() -> None:
    link = RestFleetLink(lost_after_s=0.2)
    events: list[FleetEvent] = []
    await link.start(events.append)
    here = Position(LAT, LON, 1.0)
    for time_s in (100.0, 50.0, 101.0):
        link.heard(VehicleReport("r", time_s, here))
    assert [e.time_s for e in events if isinstance(e, VehicleReport)] == [100.0, 101.0]

    def told_it_is_50() -> bool:
        link.heard(VehicleReport("r", 50.0, here))
        report = link.vehicles()[0].report
        return report is not None and report.time_s == 50.0

    await until(told_it_is_50, "nothing newer comes: the clock was set back")
    await link.close()


async def test_one_position_with_a_time_ahead_does_not_make_those_after_it_older() -> None:
    here, moment_s = Position(LAT, LON, 1.0), 1000.0
    with clock.told_by(lambda: moment_s):
        for before in ([990.0], []):
            link = RestFleetLink(lost_after_s=300.0)
            events: list[FleetEvent] = []
            await link.start(events.append)
            told = [*before, 4600.0, 1001.0, 1002.0]
            for time_s in [*told, 950.0]:
                link.heard(VehicleReport("r", time_s, here))
            assert [e.time_s for e in events if isinstance(e, VehicleReport)] == told, "what is old moves nobody back"
            await link.close()


async def test_a_time_ahead_tells_nothing_of_how_far_a_vehicle_came() -> None:
    link = RestFleetLink(lost_after_s=300.0)
    await link.start(lambda _event: None)
    with clock.told_by(lambda: 1000.0):
        report = VehicleReport("r", 999.0, Position(LAT, LON, 1.0))
        assert link.doubt(report) == ""
        link.heard(report)
        assert "at most 80 m can be" in link.doubt(VehicleReport("r", 4600.0, Position(LAT + 0.1, LON, 1.0)))
    await link.close()


async def test_a_vehicle_that_posts_no_place_where_it_can_be_is_heard_and_blind() -> None:
    link = RestFleetLink(lost_after_s=0.2)
    await link.start(lambda _event: None)
    times_s = itertools.count(1000.0)

    def post(north_deg: float) -> VehicleInfo:
        report = VehicleReport("r", next(times_s), Position(LAT + north_deg, LON, 1.0))
        if not link.doubt(report):
            link.heard(report)
        return link.vehicles()[0]

    assert not post(0.0).without_position
    places = itertools.count(1)
    await until(lambda: post(0.1 * next(places)).without_position, "it never tells where it can be")
    told = link.vehicles()[0]
    assert told.age_s is not None
    assert told.position_age_s is not None
    assert told.report_age_s == told.position_age_s > 0.2 > told.age_s
    assert not post(0.0).without_position
    await link.close()


async def test_a_vehicle_that_asks_on_and_does_not_tell_where_it_is_is_blind_once_it_should_have_arrived() -> None:
    link = RestFleetLink(1000.0, lost_after_s=0.2)
    await link.start(lambda _event: None)
    loop, times_s = asyncio.get_running_loop(), itertools.count(1000.0)
    here, there = Position(LAT, LON, 1.0), Position(LAT + 1e-3, LON, 1.0)
    leg_s = leg_time_s(horizontal_distance_m(here.lat_lon, there.lat_lon), 1.0, 1.0) / 1000.0

    def post(place: Position) -> None:
        link.heard(VehicleReport("r", next(times_s), place))

    def asks(step: int) -> bool:
        """Ask for what is newer than a step's waypoint; whether it is taken for blind then."""
        link.has_waypoint("r", step)
        return link.vehicles()[0].without_position

    post(here)
    await link.engage("r")
    sent_s = loop.time()
    assert not asks(-1)
    await until(lambda: not asks(-1) and loop.time() - sent_s > 0.3, "it waits for a waypoint for long")
    await link.order(WaypointOrder(MISSION, 1, "r", there, 1.0, 3.0, 1.0))
    sent_s = loop.time()
    assert not asks(1), "it has just been sent"
    await until(lambda: asks(1), "it is never told of")
    assert loop.time() - sent_s > 0.2 + leg_s, "it has the time for its leg"
    await link.order(WaypointOrder(MISSION, 2, "r", here, 1.0, 3.0, 1.0))
    assert asks(2), "another waypoint tells nothing of where it is"
    link.told_to_wait("r")
    await until(lambda: not asks(2), "it is held")
    post(there)
    assert not asks(2)
    await link.close()


async def test_a_vehicle_that_is_sent_elsewhere_on_its_way_has_the_time_for_both_ways() -> None:
    link = RestFleetLink(1000.0, lost_after_s=0.5)
    await link.start(lambda _event: None)
    here, far, near = (Position(LAT + away, LON, 1.0) for away in (0.0, 3e-3, 1e-4))
    loop, back_m = asyncio.get_running_loop(), horizontal_distance_m(far.lat_lon, near.lat_lon)
    way_s = leg_time_s(horizontal_distance_m(here.lat_lon, far.lat_lon) + back_m, 1.0, 1.0) / 1000.0
    link.heard(VehicleReport("r", 1000.0, here))
    await link.engage("r")
    sent_s = loop.time()
    for step, place in enumerate((far, near), start=1):
        await link.order(WaypointOrder(MISSION, step, "r", place, 1.0, 3.0, 1.0))
        link.has_waypoint("r", step)

    def is_blind() -> bool:
        link.has_waypoint("r", 2)
        return link.vehicles()[0].without_position

    await until(is_blind, "it never told where it is")
    assert loop.time() - sent_s > way_s
    await link.close()


async def test_a_vehicle_that_waits_where_it_was_sent_or_comes_back_after_silence_owes_no_place() -> None:
    link = RestFleetLink(1000.0, lost_after_s=0.5)
    await link.start(lambda _event: None)
    here, there = Position(LAT, LON, 1.0), Position(LAT + 1e-4, LON, 1.0)
    link.heard(VehicleReport("r", 1000.0, here))
    await link.engage("r")
    await link.order(WaypointOrder(MISSION, 1, "r", there, 1.0, 3.0, 1.0))
    loop = asyncio.get_running_loop()
    allowed_s = 0.5 + leg_time_s(horizontal_distance_m(here.lat_lon, there.lat_lon), 1.0, 1.0) / 1000.0
    link.has_waypoint("r", 1)
    await until(lambda: link.vehicles()[0].state is LinkState.LOST, "it is silent")
    silent_s = loop.time()
    await until(lambda: loop.time() - silent_s > allowed_s, "it is silent for longer than its way takes")
    link.has_waypoint("r", 1)
    assert not link.vehicles()[0].without_position, "it could not tell"
    link.heard(VehicleReport("r", 1001.0, there))
    arrived_s = loop.time()

    def has_waited() -> bool:
        link.has_waypoint("r", 1)
        assert not link.vehicles()[0].without_position
        return loop.time() - arrived_s > 2 * allowed_s

    await until(has_waited, "it waits for its next waypoint")
    await link.close()


async def test_a_vehicle_that_posts_only_what_it_kept_is_not_blind() -> None:
    link = RestFleetLink(lost_after_s=0.1)
    await link.start(lambda _event: None)
    here, loop = Position(LAT, LON, 1.0), asyncio.get_running_loop()
    link.heard(VehicleReport("r", 1000.0, here))
    await link.engage("r")
    await link.order(WaypointOrder(MISSION, 1, "r", here, 50.0, 3.0, 1.0))
    link.has_waypoint("r", 1)
    sent_s, kept_s = loop.time(), itertools.count(500.0)

    def posts_on() -> bool:
        link.heard(VehicleReport("r", next(kept_s), here))
        link.has_waypoint("r", 1)
        assert not link.vehicles()[0].without_position
        return loop.time() - sent_s > 0.3

    await until(posts_on, "time passes")
    await link.close()


async def test_a_clock_that_is_always_ahead_is_the_vehicles_own() -> None:
    link = RestFleetLink(lost_after_s=0.2)
    await link.start(lambda _event: None)
    here, times_s = Position(LAT, LON, 1.0), itertools.count(5000.0)

    def moved_back() -> bool:
        """Post what is new, and what was kept; whether that moved it back."""
        link.heard(VehicleReport("r", newest_s := next(times_s), here))
        link.heard(VehicleReport("r", newest_s - 500.0, here))
        report = link.vehicles()[0].report
        return report is not None and report.time_s < newest_s

    with clock.told_by(lambda: 1000.0):
        assert moved_back()
        await until(lambda: not moved_back(), "its clock is known")
        assert not moved_back()
    await link.close()


async def test_a_stranger_that_is_told_to_stop_is_not_taken_up() -> None:
    link = RestFleetLink()
    await link.start(lambda _event: None)
    link.told_to_stop("nobody", "m")
    assert link.vehicles() == []
    await link.close()


async def test_a_waypoint_counts_as_reached_only_once_the_vehicle_has_it() -> None:
    link = RestFleetLink()
    events: list[FleetEvent] = []
    await link.start(events.append)
    here = Position(LAT, LON, 1.0)
    link.heard(VehicleReport("r", 1.0, here))
    await link.engage("r")
    await link.order(WaypointOrder(MISSION, 7, "r", here, 1.0, 3.0, 1.0))
    link.heard(VehicleReport("r", 2.0, here))
    link.has_waypoint("r", 6)
    assert [e.status for e in events if isinstance(e, WaypointReport)] == [S]
    link.has_waypoint("r", 7)
    assert [e.status for e in events if isinstance(e, WaypointReport)] == [S, A, R]
    await link.close()
