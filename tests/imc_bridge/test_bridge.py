"""Vehicles (fake DUNE nodes on real sockets) follow waypoints, and every way in which that can end."""

import asyncio
import statistics
from functools import partial

import imcpy
import pytest

from imc_bridge import (
    Bridge,
    Guidance,
    LinkChange,
    NodeState,
    RefusedError,
    Sounding,
    SoundSpeedSample,
    WaypointChange,
    WaypointStatus,
)
from imc_bridge.control.controls import Controls
from imc_bridge.control.plans import OPERATION_START, plan_control
from imc_bridge.control.rates import DUNE_DEFAULTS
from imc_bridge.network.codec import encode
from imc_bridge.network.transport import Address
from imc_bridge.nodes.node import Node
from simulator.dune.entities import SIMULATION
from tests.support.imc.sea import Peer, Sea, open_sea
from tests.support.ports import free_ports
from tests.support.waiting import until

S, A, R = WaypointStatus.SENT, WaypointStatus.ACKNOWLEDGED, WaypointStatus.REACHED


def truth_errors(sea: Sea) -> list[float]:
    """Sounded minus true depth at every footprint within the terrain."""
    errors = []
    for sounding in sea.of(Sounding):
        east, north = sea.floor.frame.to_local(sounding.lat_deg, sounding.lon_deg)
        if sea.floor.contains(east, north):
            errors.append(sounding.bottom_depth_m - sea.floor.depth_at_point(east, north))
    return errors


@pytest.mark.slow
@pytest.mark.parametrize(
    ("loss", "sensor"), [(0.0, "single"), (0.05, "single"), (0.0, "dvl")], ids=["clean", "5 % loss", "dvl"]
)
async def test_two_vehicles_follow_three_waypoints_and_stop(loss: float, sensor: str) -> None:
    async with open_sea(vehicles=2, loss=loss, equipment={"sensor": sensor}) as sea:
        names = await sea.ready()
        await asyncio.gather(*(sea.bridge.engage(name) for name in names))
        assert all(node.engaged for node in sea.bridge.nodes())
        for step, (east, north, depth) in enumerate([(40, 30, 2.0), (60, 50, 1.0), (30, 40, 2.0)]):
            for k, name in enumerate(names):
                sea.bridge.goto(name, sea.waypoint(step, east + 15 * k, north, depth))
            for name in names:
                await sea.reached(name, step)
        stops = await asyncio.gather(*(sea.bridge.stop(name) for name in names))
        assert all(stop.acknowledged for stop in stops)
        for name in names:
            for step in range(3):
                assert sea.statuses(name, step) == [S, A, R]
        await until(
            lambda: all(n.state is NodeState.READY and not n.engaged for n in sea.bridge.nodes()), "all are free"
        )
    errors = truth_errors(sea)
    assert len(errors) > 200
    assert abs(statistics.mean(errors)) < 0.1
    assert statistics.mean(map(abs, errors)) < 0.2
    sources = {sounding.source for sounding in sea.of(Sounding)}
    assert sources == ({"Altimeter"} if sensor == "single" else {f"DVL Beam {k}" for k in range(4)})
    assert all(sounding.position_sd_m is not None for sounding in sea.of(Sounding)[-20:])


async def test_what_a_probe_on_board_tells_of_the_water_is_heard_with_its_place() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        (node,) = sea.fleet.nodes
        await until(lambda: bool(sea.bridge.nodes()[0].entities), "its entities have names")

        def told(count: int) -> bool:
            return len(sea.of(SoundSpeedSample)) == count

        def later(time_s: float) -> bool:
            return node.vehicle.time_s > time_s

        for count, value in enumerate((1507.5, 343.0, 1508.5)):
            await until(partial(told, min(count, 1)), "what can be is told")
            message = imcpy.SoundSpeed()
            message.value = value
            sent_s = node.vehicle.time_s
            node.send(message, SIMULATION["CTD"])
            await until(partial(later, sent_s), "each has a time of its own")
        await until(partial(told, 2), "both are told")
    for one in sea.of(SoundSpeedSample):
        assert (one.vehicle, one.source) == (name, "CTD")
        east, north = sea.floor.frame.to_local(one.lat_deg, one.lon_deg)
        assert sea.floor.contains(east, north)
        assert 0.0 <= one.depth_m < 1.0, "it floats"
    assert [one.speed_mps for one in sea.of(SoundSpeedSample)] == [1507.5, 1508.5]


async def test_repeated_order_is_harmless_and_a_new_one_replaces_the_old() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        await sea.bridge.engage(name)
        first = sea.waypoint(0, 50, 90, 1.0)
        sea.bridge.goto(name, first)
        sea.bridge.goto(name, first)
        await until(lambda: A in sea.statuses(name, 0), "the first was acknowledged")
        sea.bridge.goto(name, sea.waypoint(1, 50, 35, 1.0))
        await sea.reached(name, 1)
        assert sea.statuses(name, 0) == [S, A]
        assert sea.statuses(name, 1) == [S, A, R]


async def test_what_goes_wrong_for_one_vehicle_keeps_no_reference_from_another(monkeypatch: pytest.MonkeyPatch) -> None:
    async with open_sea(vehicles=2) as sea:
        first, second = await sea.ready()
        await sea.bridge.engage(second)
        tick = Controls.tick

        def failing(controls: Controls, node: Node, now: float) -> None:
            if node.name == first:
                raise ValueError("a figure that nobody expected")
            tick(controls, node, now)

        monkeypatch.setattr(Controls, "tick", failing)
        sea.bridge.goto(second, sea.waypoint(0, 50, 50, 1.0))
        await sea.reached(second, 0)
        assert set(sea.bridge.handler_errors) == {"ValueError"}
        monkeypatch.undo()


async def test_waypoint_close_by_counts_as_reached_where_the_vehicle_circles() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 50, 1.0))
        await sea.reached(name, 0)
        sea.bridge.goto(name, sea.waypoint(1, 50, 56, 1.0, arrival_radius_m=0.5))
        await sea.reached(name, 1)
        (arrival,) = [c for c in sea.of(WaypointChange) if c.waypoint.step == 1 and c.status is R]
        assert "as near as the vehicle comes" in arrival.reason


@pytest.mark.parametrize("away_m", [15.5, 16.5, 17.5])
async def test_a_waypoint_at_the_surface_is_flown_to_unless_the_vehicle_would_drift_there(away_m: float) -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        here = sea.fleet.nodes[0].vehicle.position
        east_m, north_m = here.east_m, here.north_m + away_m
        sea.bridge.goto(name, sea.waypoint(0, east_m, north_m, 0.0, arrival_radius_m=3.0))
        await sea.reached(name, 0)
        now = sea.fleet.nodes[0].vehicle.position
        assert now.horizontal_distance_m(east_m, north_m) < away_m - 5.0, "it flew there"


@pytest.mark.slow
@pytest.mark.parametrize("family", ["slope", "smooth"])
async def test_guard_keeps_the_vehicle_off_the_bottom(family: str) -> None:
    async with open_sea(family=family) as sea:
        (name,) = await sea.ready()
        await until(lambda: bool(sea.of(Sounding)), "the bottom was measured")
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 60, 60.0, min_altitude_m=3.0))
        await sea.reached(name, 0)
        vehicle = sea.fleet.nodes[0].vehicle
        clearance = vehicle.bottom_m - vehicle.true_position.depth_m
        assert clearance > 2.5
        (arrival,) = [c for c in sea.of(WaypointChange) if c.status is R]
        assert "3 m above the bottom" in arrival.reason
        altitudes = [s.bottom_depth_m - s.vehicle_depth_m for s in sea.of(Sounding)]
        # It knows the bottom only when it is there: on the way up it comes closer than it should.
        assert min(altitudes) > 1.0


async def test_unknown_vehicle_and_unengaged_vehicle_are_refused_with_a_remedy() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        with pytest.raises(RefusedError, match=rf"never heard of \(known: {name}\)"):
            await sea.bridge.engage("nobody")
        with pytest.raises(RefusedError, match=r"not engaged\. Engage it first"):
            sea.bridge.goto(name, sea.waypoint(0, 50, 50, 1.0))
        assert not (await sea.bridge.stop("nobody")).acknowledged
        assert (await sea.bridge.stop(name)).acknowledged


async def test_stop_is_safe_to_repeat_and_to_follow_by_engaging_again() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()

        def acknowledged(step: int) -> bool:
            return A in sea.statuses(name, step)

        for step in range(2):
            await sea.bridge.engage(name)
            sea.bridge.goto(name, sea.waypoint(step, 50, 60, 1.0))
            await until(partial(acknowledged, step), "it was acknowledged")
            for stop in await asyncio.gather(sea.bridge.stop(name), sea.bridge.stop(name)):
                assert stop.acknowledged
            assert (await sea.bridge.stop(name)).acknowledged


async def test_silent_vehicle_is_lost_its_stop_unacknowledged_and_its_waypoint_refused() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 90, 1.0))
        await until(lambda: A in sea.statuses(name, 0), "it was acknowledged")
        await sea.vanish()
        await until(lambda: sea.of(LinkChange)[-1].state is NodeState.LOST, "it is lost")
        lost = sea.of(LinkChange)[-1]
        assert "silent for" in lost.reason
        await until(lambda: WaypointStatus.REFUSED in sea.statuses(name, 0), "its waypoint was given up")
        with pytest.raises(RefusedError, match="silent"):
            sea.bridge.goto(name, sea.waypoint(1, 50, 50, 1.0))
        with pytest.raises(RefusedError, match="doctor"):
            await sea.bridge.engage(name)
        stop = await sea.bridge.stop(name, timeout_s=0.3)
        assert not stop.acknowledged
        assert "no acknowledgement within 0.3 s" in stop.detail


@pytest.mark.slow
async def test_vehicle_that_reboots_goes_on_to_its_waypoint() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 70, 1.0))
        await until(lambda: A in sea.statuses(name, 0), "it was acknowledged")
        await sea.vanish()
        await sea.launch()
        await sea.reached(name, 0)
        assert sea.statuses(name, 0) == [S, A, R]


async def test_vehicle_that_follows_an_earlier_run_of_ours_is_engaged_anew() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 90, 1.0))
        await until(lambda: A in sea.statuses(name, 0), "it was acknowledged")
        # As kill -9 does: nobody says stop.
        sea.bridge._task.cancel()
        sea.bridge.transport.close()
        sea.events.clear()
        await sea.connect()
        await until(lambda: sea.state(name) in (NodeState.IN_PLAN, NodeState.READY), "it is heard again")
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(1, 50, 40, 1.0))
        await sea.reached(name, 1)
        assert sea.statuses(name, 0) == [], "nobody asked this bridge for that"
        assert sea.statuses(name, 1) == [S, A, R]


class Console(Peer):
    """Another console, which the vehicles know."""

    async def introduce(self, sea: Sea) -> None:
        for port in self.settings.announce_ports:
            self.announce(port, sys_type=imcpy.SystemType.CCU)
        await asyncio.sleep(0)

    def command(self, sea: Sea, message: imcpy.Message) -> None:
        packet = encode(message, src=self.imc_id, dst=sea.fleet.nodes[0].imc_id, time_s=1.7e9)
        self.sock.sendto(packet, sea.fleet.nodes[0].address)


async def test_abort_by_another_console_is_respected() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        console = Console(sea.settings, 0x4001, "ccu-other")
        await console.introduce(sea)
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 90, 1.0))
        await until(lambda: A in sea.statuses(name, 0), "it was acknowledged")
        console.command(sea, imcpy.Abort())
        await until(lambda: WaypointStatus.REFUSED in sea.statuses(name, 0), "its waypoint was given up")
        refused = next(c for c in sea.of(WaypointChange) if c.status is WaypointStatus.REFUSED)
        assert "abort" in refused.reason
        assert not sea.bridge.nodes()[0].engaged
        # A human may give it back to us.
        await until(lambda: sea.state(name) is NodeState.READY, "it is in service again")
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 40, 1.0))
        await sea.reached(name, 0)
        console.close()


async def test_vehicle_in_another_consoles_plan_is_neither_engaged_nor_stopped() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.close()
        other = await sea.connect(id=0x4001, name="ccu-other", port=free_ports(1)[0], plan_id="theirs")
        await until(lambda: sea.state(name) is NodeState.READY, "the other console hears it")
        await other.engage(name)
        ours = Bridge(sea.settings.changed(id=0x3F05, port=free_ports(1)[0], plan_id="ours"))
        await ours.start(lambda event: None)
        try:
            await until(
                lambda: any(n.name == name and n.state is NodeState.IN_PLAN for n in ours.nodes()), "we see its plan"
            )
            with pytest.raises(RefusedError, match=r"plan 'theirs' of another console.*Stop that plan"):
                await ours.engage(name)
            stop = await ours.stop(name)
            assert stop.acknowledged
            assert "another console" in stop.detail
            assert sea.fleet.nodes[0].plan.maneuver is not None
        finally:
            await ours.close()


async def test_closing_stops_every_vehicle_and_restores_its_rates() -> None:
    async with open_sea(vehicles=2) as sea:
        names = await sea.ready()
        former = [node._rate_text for node in sea.fleet.nodes]
        await asyncio.gather(*(sea.bridge.engage(name) for name in names))
        await until(lambda: all("Distance:5" in node._rate_text for node in sea.fleet.nodes), "the rates were set")
        assert all(node.plan.maneuver is not None for node in sea.fleet.nodes)
        assert not any("Distance:5" in text for text in former)
        await sea.bridge.close()
        await until(lambda: all(node.plan.maneuver is None for node in sea.fleet.nodes), "none follows any more")
        await until(lambda: [node._rate_text for node in sea.fleet.nodes] == former, "the rates are as before")


async def test_rates_are_restored_though_packets_are_lost() -> None:
    async with open_sea(loss=0.3) as sea:
        (name,) = await sea.ready()
        node = sea.fleet.nodes[0]
        # A vehicle that never got to tell its own rates is given those that DUNE comes with.
        restored = {node._rate_text, DUNE_DEFAULTS}
        await sea.bridge.engage(name)
        await until(lambda: "Distance:5" in node._rate_text, "the rates were set")
        result = await sea.bridge.stop(name, timeout_s=20.0)
        assert result.acknowledged, result
        assert not any("Distance:5" in text for text in restored)
        await until(lambda: node._rate_text in restored, "the rates are as before")


async def test_rates_are_sent_until_the_vehicle_reports_them() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        node, send = sea.fleet.nodes[0], sea.bridge.transport.send
        former = node._rate_text
        await sea.bridge.engage(name)
        await until(lambda: "Distance:5" in node._rate_text, "the rates were set")
        setting = imcpy.SetEntityParameters().msg_id.to_bytes(2, "little")
        lost: list[bytes] = []

        def send_but_the_first(packet: bytes, address: Address) -> bool:
            if packet[2:4] == setting and len(lost) < 8:
                lost.append(packet)
                return True
            return send(packet, address)

        sea.bridge.transport.send = send_but_the_first
        await sea.bridge.stop(name, timeout_s=20.0)
        await until(lambda: node._rate_text == former, "the rates are as before")
        known = sea.bridge._registry.named(name)
        assert known is not None
        request = sea.bridge._controls.asked_rates(known)
        assert request is not None
        await until(lambda: not request.restoring, "it has heard so and sends no more")
        assert len(lost) == 8


@pytest.mark.parametrize("north_m", [30.0, 95.0], ids=["near: DUNE expects a new path", "far: it times out"])
async def test_plan_that_ended_for_want_of_references_is_taken_up_again(north_m: float) -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, north_m, 1.0))
        await until(lambda: A in sea.statuses(name, 0), "it was acknowledged")
        node, send = sea.fleet.nodes[0], sea.bridge.transport.send
        reference = imcpy.Reference().msg_id.to_bytes(2, "little")
        sea.bridge.transport.send = lambda packet, address: packet[2:4] == reference or send(packet, address)
        await until(lambda: node.plan.maneuver is None, "the vehicle has given up")
        sea.bridge.transport.send = send
        await sea.reached(name, 0)
        assert sea.statuses(name, 0) == [S, A, R]


def foreign_start(sea: Sea, source: int, plan_id: str, control_src: int) -> bytes:
    """A START of another console for the first vehicle."""
    settings = sea.settings.changed(id=control_src, plan_id=plan_id)
    return encode(plan_control(OPERATION_START, 1, settings), src=source, dst=sea.fleet.nodes[0].imc_id, time_s=1.7e9)


@pytest.mark.parametrize("plan_id", ["home", "bathyfleet-3F01"])
async def test_vehicle_that_another_console_takes_over_is_let_go(plan_id: str) -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        console = Console(sea.settings, 0x4001, "ccu-other")
        await console.introduce(sea)
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 90, 1.0))
        await until(lambda: A in sea.statuses(name, 0), "it was acknowledged")
        packet = foreign_start(sea, 0x4001, plan_id, 0x4001)
        console.sock.sendto(packet, sea.fleet.nodes[0].address)
        await until(lambda: WaypointStatus.REFUSED in sea.statuses(name, 0), "its waypoint was given up")
        refused = next(c for c in sea.of(WaypointChange) if c.status is WaypointStatus.REFUSED)
        assert "took over with" in refused.reason
        assert sea.bridge.intervention(name)
        # The other console keeps it: we neither stop nor steer it.
        maneuver = sea.fleet.nodes[0].plan.maneuver
        assert maneuver is not None
        assert maneuver.control_src == 0x4001
        with pytest.raises(RefusedError, match="of another console"):
            await sea.bridge.engage(name)
        await sea.bridge.stop(name)
        assert sea.fleet.nodes[0].plan.maneuver is maneuver
        console.close()


async def test_vehicle_that_is_still_booting_is_engaged_when_it_is_ready() -> None:
    async with open_sea(boot_s=12.0) as sea:
        await until(lambda: sea.state("lauv-sim-1") is NodeState.ACTIVE, "it is heard")
        assert "boot" in sea.bridge.nodes()[0].reason
        await sea.bridge.engage("lauv-sim-1")
        assert sea.fleet.nodes[0].plan.maneuver is not None


async def test_plan_that_the_vehicle_refuses_is_told_in_its_words() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        plan = sea.fleet.nodes[0].plan
        plan._start = lambda message, request, now_s: plan._reply(
            message.op, request, message.plan_id, "vehicle is not ready: DVL error", ok=False
        )
        with pytest.raises(RefusedError, match=r"plan refused: vehicle is not ready: DVL error\. Clear what"):
            await sea.bridge.engage(name)
        assert not sea.bridge.nodes()[0].engaged


@pytest.mark.slow
@pytest.mark.parametrize("guidance", [Guidance.FOLLOW, Guidance.LEGS])
async def test_waypoints_are_reached_in_a_current_of_half_the_speed(guidance: Guidance) -> None:
    async with open_sea(family="flat", current=(0.35, -0.35), bridge={"unknown_bottom_depth_m": 0.0}) as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name, guidance)
        for step, (east, north) in enumerate([(30, 60), (70, 60), (30, 30)]):
            sea.bridge.goto(name, sea.waypoint(step, east, north, 1.0, speed_mps=1.0))
            await sea.reached(name, step)
            assert sea.statuses(name, step) == [S, A, R]
            assert sea.fleet.nodes[0].vehicle.position.horizontal_distance_m(east, north) < 15.0
