"""Orders to vehicles that survey: carried out once, within every limit, through restarts, or refused with reasons."""

import asyncio
from typing import Any

import numpy as np
import pytest
from shapely import Polygon
from sqlalchemy import select

from app.missions.errors import ConflictError, InvalidRequestError, VehicleNotFoundError
from app.missions.flight import own_legs
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.separation import too_close
from app.missions.flight.legs import spacing
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.demand import LegDemand
from app.missions.flight.orders import orders_of
from app.missions.live.mission import LiveMission
from app.missions.operations.history import events_after
from app.missions.running import vehicle_orders
from app.missions.running.homecoming import hold
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from app.missions.spec.orders import DenserOrder, GoOrder, OrderState, RepeatOrder
from app.missions.states import MissionState
from app.missions.team import Member
from app.storage.database import Database
from app.storage.models import WaypointRow
from app.storage.queries import missions as mission_queries
from tests.support.missions.harbour import Harbour, act, sim_spec, until_state, until_step
from tests.support.missions.specs import FRAME, lon_lat, rectangle
from tests.support.waiting import until

LINES = {"name": "lawnmower"}
LIMITS = {"max_step_m": 8.0, "min_separation_m": 2.0}

pytestmark = pytest.mark.usefixtures("simulated_time")


def survey(*names: str, **changes: Any) -> MissionSpec:
    spec = {"steps": 1000, "side_m": 80.0, "planner": LINES, "limits": LIMITS}
    return sim_spec(*names, **(spec | changes))


async def flying(service: MissionService, spec: MissionSpec, step: int = 4) -> LiveMission:
    mission = await service.create(spec)
    await act(service, mission.id, "start")
    await until_step(service, mission.id, step)
    return await service.get(mission.id)


async def until_told(*members: Member) -> None:
    """Wait until vehicles have reported their position once more."""
    before = [member.report for member in members]

    def told() -> bool:
        return all(member.report is not was for member, was in zip(members, before, strict=True))

    await until(told, "they report again")


async def until_over(live: LiveMission, order_id: int, state: OrderState = OrderState.DONE) -> None:
    async def over() -> bool:
        order = next(one for one in await orders_of(live) if one.id == order_id)
        assert order.state in (OrderState.ACCEPTED, OrderState.FLYING, state), order
        return order.state is state

    await until(over, f"order {order_id} is {state}")


async def legs_of(database: Database, live: LiveMission, name: str) -> list[tuple[int, float, float, str]]:
    async with database.reading() as session:
        rows = await session.scalars(
            select(WaypointRow)
            .where(WaypointRow.mission_id == live.id, WaypointRow.vehicle == name)
            .order_by(WaypointRow.step)
        )
        return [(row.step, row.east_m, row.north_m, row.status) for row in rows]


def ends_at(legs: list[tuple[int, float, float, str]], east_m: float, north_m: float) -> list[str]:
    return [status for _, east, north, status in legs if np.hypot(east - east_m, north - north_m) < 0.5]


@pytest.mark.slow
async def test_a_vehicle_goes_where_it_is_sent_and_then_goes_on(service: MissionService, database: Database) -> None:
    zone = rectangle(30.0, 30.0, 50.0, 50.0)
    live = await flying(service, survey("a", "b", keep_out=[zone]))
    order = await vehicle_orders.go(live, "a", GoOrder(position=lon_lat(70.0, 70.0)), "Ana {1}")
    assert (order.vehicle, order.state) == ("a", OrderState.ACCEPTED)
    shown = next(view for view in live.vehicles.all() if view.name == "a").order
    assert shown is not None
    assert shown.asked_by == "Ana {1}", "a name may hold anything"
    await until_over(live, order.id)

    async def reached() -> bool:
        # Legs that a zone bars from where the vehicle has come to are given up, and decided again.
        return ends_at(await legs_of(database, live, "a"), 70.0, 70.0).count("reached") == 1

    await until(reached, "that is written down, once")
    number = live.team.members["a"].legs
    await until(lambda: live.team.members["a"].legs > number + 2, "a goes on with its lines")
    await act(service, live.id, "abort")
    inside = Polygon(live.spec.local_area()).buffer(1e-3)
    for _, east, north, _ in await legs_of(database, live, "a"):
        assert inside.contains(Polygon([(east, north), (east + 1e-4, north), (east, north + 1e-4)]))
        assert not (30.0 < east < 50.0 and 30.0 < north < 50.0)
    told = [line.message for line in await events_after(live, 0, 1000) if line.kind == "order"]
    assert any("ordered by Ana {1}" in words for words in told)
    assert any("goes on with its part" in words for words in told)
    assert not [line for line in await events_after(live, 0, 1000) if line.kind == "boundary"]


@pytest.mark.slow
async def test_an_order_whose_legs_wait_for_another_vehicle_is_carried_out(
    service: MissionService, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    # All its legs are decided at once, with some of another vehicle's, and the first one has to wait.
    live = await flying(service, survey("a", "b"))
    barred = 0

    def close(decision: Decision, live: LiveMission, spec: MissionSpec) -> dict[str, str]:
        nonlocal barred
        found = too_close(decision, live, spec)
        both = {leg.vehicle for leg in decision.legs if not leg.refusal} == {"a", "b"}
        if live.team.members["a"].asked is None or barred == 3 or not both:
            return found
        barred += 1
        return {"a": "b passes"} | found

    decide, stored = own_legs.OwnLegs._decide, []

    async def decide_and_look(legs: own_legs.OwnLegs, getting: list[Member]) -> None:
        before = barred
        await decide(legs, getting)
        if barred > before:
            async with database.reading() as session:
                step = await mission_queries.last_step(session, live.id)
            assert step is not None
            stored.append(step.memory == legs._decider.planner.snapshot())

    monkeypatch.setattr(spacing, "too_close", close)
    monkeypatch.setattr(own_legs.OwnLegs, "_decide", decide_and_look)
    monkeypatch.setattr(LegDemand, "legs_at_once", lambda *_: 12)
    order = await vehicle_orders.go(live, "a", GoOrder(position=lon_lat(70.0, 70.0)), "Ana")
    await until_over(live, order.id)
    assert barred > 0
    assert stored
    assert all(stored), "so that a restart goes on from what is known now"
    assert any(np.hypot(east - 70.0, north - 70.0) < 0.5 for _, east, north, _ in await legs_of(database, live, "a"))


async def test_what_cannot_be_flown_is_refused_with_what_would_be_right(service: MissionService) -> None:
    zone = rectangle(30.0, 30.0, 50.0, 50.0)
    live = await flying(service, survey("a", "b", keep_out=[zone], steps=12), step=2)
    with pytest.raises(InvalidRequestError, match="outside the area"):
        await vehicle_orders.go(live, "a", GoOrder(position=lon_lat(200.0, 10.0)), "Ana")
    with pytest.raises(InvalidRequestError, match="keep-out zone"):
        await vehicle_orders.go(live, "a", GoOrder(position=lon_lat(40.0, 40.0)), "Ana")
    with pytest.raises(InvalidRequestError, match="far from the mission"):
        await vehicle_orders.repeat_line(live, "a", RepeatOrder(near=(8.0, 50.0)), "Ana")
    lon, lat = lon_lat(10.0, 10.0)
    with pytest.raises(InvalidRequestError, match="far from the mission") as exchanged:
        await vehicle_orders.go(live, "a", GoOrder(position=(lat, lon)), "Ana")
    assert "latitude and longitude look exchanged" in exchanged.value.remedy
    with pytest.raises(VehicleNotFoundError, match="takes no part"):
        await vehicle_orders.go(live, "nobody", GoOrder(position=lon_lat(10.0, 10.0)), "Ana")
    large = DenserOrder.model_validate({"area": rectangle(5.0, 5.0, 75.0, 28.0), "line_spacing_m": 2.0})
    away = DenserOrder.model_validate({"area": rectangle(300.0, 5.0, 310.0, 28.0), "line_spacing_m": 2.0})
    with pytest.raises(ConflictError, match="m are left of its way"):
        await vehicle_orders.survey_denser(live, large, "Ana")
    with pytest.raises(InvalidRequestError, match="inside the area"):
        await vehicle_orders.survey_denser(live, away, "Ana")
    assert await orders_of(live) == []
    await act(service, live.id, "pause")
    with pytest.raises(ConflictError, match="paused"):
        await vehicle_orders.skip_line(live, "a", "Ana")


@pytest.mark.slow
async def test_energy_that_does_not_last_for_the_way_home_refuses_the_order(service: MissionService) -> None:
    vehicles = [{"name": "a", "kind": "sim", "endurance_min": 9.0, "speed_mps": 1.0}]
    recovery = {"point": lon_lat(5.0, 5.0)}
    live = await flying(service, survey(vehicles=vehicles, recovery=recovery, side_m=400.0), step=2)
    await until(lambda: live.team.members["a"].energy.left is not None, "its energy is known")
    with pytest.raises(ConflictError, match="energy of 'a' does not last"):
        await vehicle_orders.go(live, "a", GoOrder(position=lon_lat(390.0, 390.0)), "Ana")
    order = await vehicle_orders.go(live, "a", GoOrder(position=lon_lat(30.0, 30.0)), "Ana")
    await until_over(live, order.id)
    await act(service, live.id, "abort")


@pytest.mark.slow
async def test_a_line_is_left_out_flown_again_and_a_part_looked_at_closer(
    service: MissionService, database: Database
) -> None:
    live = await flying(service, survey("a"), step=5)
    a = live.team.members["a"]
    skipped = await vehicle_orders.skip_line(live, "a", "Ana")
    await until_over(live, skipped.id)
    number = a.legs
    await until(lambda: a.legs > number + 4, "it flies another line")
    again = await vehicle_orders.repeat_line(live, "a", RepeatOrder(), "Ana")
    assert len(again.way) >= 2
    await until_over(live, again.id)
    near = await vehicle_orders.repeat_line(live, "a", RepeatOrder(near=again.way[0]), "Ana")
    denser = DenserOrder.model_validate({"area": rectangle(40.0, 40.0, 60.0, 55.0), "line_spacing_m": 5.0})
    closer = await vehicle_orders.survey_denser(live, denser, "Bo")
    assert next(one for one in await orders_of(live) if one.id == near.id).state is OrderState.REPLACED
    with pytest.raises(ConflictError, match="Bo ordered"):
        await vehicle_orders.skip_line(live, "a", "Ana")
    await until_over(live, closer.id)
    corners = [FRAME.to_local(np.array(lat), np.array(lon)) for lon, lat in closer.way]
    assert len(corners) == 6

    async def flown() -> bool:
        legs = await legs_of(database, live, "a")
        return all("reached" in ends_at(legs, float(east), float(north)) for east, north in corners)

    await until(flown, "every corner is written down as reached")
    await act(service, live.id, "abort")


async def test_an_order_is_ended_by_resuming_the_vehicle_or_calling_it_home(service: MissionService) -> None:
    live = await flying(service, survey("a", "b", side_m=300.0, recovery={"point": lon_lat(5.0, 5.0)}))
    far = GoOrder(position=lon_lat(290.0, 290.0))
    order = await vehicle_orders.go(live, "a", far, "Ana")
    await service.send_on(live, "a", "Bo")
    await until_over(live, order.id, OrderState.CANCELLED)
    with pytest.raises(ConflictError, match="is surveying"):
        await service.send_on(live, "a", "Bo")
    order = await vehicle_orders.go(live, "a", far, "Ana")
    await hold(live, "a", "Bo")
    with pytest.raises(ConflictError, match="held by Bo"):
        await vehicle_orders.go(live, "a", far, "Ana")
    await until(lambda: live.team.members["a"].ordered is False, "a holds")
    assert live.team.members["a"].asked is not None, "it goes there when it is resumed"
    await act(service, live.id, "abort")
    assert (await orders_of(live))[0].state is OrderState.CANCELLED


@pytest.mark.slow
async def test_holding_everybody_is_a_pause(service: MissionService) -> None:
    live = await flying(service, survey("a", "b", steps=15), step=2)
    await hold(live, "a", "Ana")
    await hold(live, "b", "Ana")
    a, b = live.team.members["a"], live.team.members["b"]

    def held() -> bool:
        return all(m.withdrawal is not None and m.withdrawal.led and not m.ordered and not m.ahead for m in (a, b))

    await until(held, "both have given up their legs")
    # A leg that was being decided when they were held may still be counted; nobody flies it.
    for _ in range(5):
        await until_told(a, b)
        assert held()
    assert live.header.state is MissionState.RUNNING
    await service.send_on(live, "b", "Ana")
    await until(lambda: b.legs == 15 and not b.ordered, "b is done")
    assert live.header.state is MissionState.RUNNING, "a still waits for a person"
    await service.send_on(live, "a", "Ana")
    await until_state(service, live.id, MissionState.FINISHED)


@pytest.mark.slow
@pytest.mark.parametrize("after", ["accepted", "legs"])
async def test_a_restart_neither_loses_nor_repeats_an_order(
    harbour: Harbour, database: Database, monkeypatch: pytest.MonkeyPatch, after: str
) -> None:
    service = harbour.service
    live = await flying(service, survey("a"))
    if after == "accepted":
        # What comes after it was accepted is never written.
        monkeypatch.setattr(LegCommit, "commit", _never)
    order = await vehicle_orders.go(live, "a", GoOrder(position=lon_lat(70.0, 70.0)), "Ana")
    if after == "legs":
        await until(lambda: (m := live.team.members["a"].asked) is None or m.state is OrderState.FLYING, "it is taken")
        number = live.team.members["a"].legs
        await until(lambda: live.team.members["a"].legs > number + 1, "some of its legs are committed")
    await harbour.close()
    monkeypatch.undo()
    service = await harbour.open()
    live = await service.get(live.id)
    await until_over(live, order.id)
    number = live.team.members["a"].legs
    await until(lambda: live.team.members["a"].legs > number + 3, "it goes on")
    # Once more: nothing is done twice.
    service = await harbour.reopen()
    live = await service.get(live.id)
    number = live.team.members["a"].legs
    await until(lambda: live.team.members["a"].legs > number + 3, "it goes on after that, too")
    assert len([one for one in await orders_of(live) if one.state is OrderState.DONE]) == 1
    legs = await legs_of(database, live, "a")
    assert ends_at(legs, 70.0, 70.0).count("reached") == 1
    await act(service, live.id, "abort")


async def _never(*_: Any) -> None:
    await asyncio.Event().wait()


@pytest.mark.slow
async def test_legs_that_an_order_replaces_take_nothing_of_the_length(
    service: MissionService, database: Database
) -> None:
    spec = sim_spec("a", side_m=80.0, planner=LINES, limits=LIMITS, budget={"km_per_vehicle": 2.0})
    live = await flying(service, spec, step=6)
    a = live.team.members["a"]
    for place in ((70.0, 70.0), (10.0, 70.0), (70.0, 10.0), (10.0, 10.0)):
        order = await vehicle_orders.go(live, "a", GoOrder(position=lon_lat(*place)), "Ana")
        await until_over(live, order.id)
    used_m, ahead_m = 2000.0 - a.way_left_m(live.spec), a.way_ahead_m(live.frame)
    assert used_m - ahead_m <= a.flown.flown_m + 3 * LIMITS["max_step_m"]
    # What is taken up again knows that the order is over, and whatever is left of the length.
    ends = len(await legs_of(database, live, "a"))
    await act(service, live.id, "pause")
    await act(service, live.id, "resume")
    await until_step(service, live.id, ends + 3)
    used_m, ahead_m = 2000.0 - a.way_left_m(live.spec), a.way_ahead_m(live.frame)
    assert used_m - ahead_m <= a.flown.flown_m + 3 * LIMITS["max_step_m"]
    async with database.reading() as session:
        reasons = await session.scalars(select(WaypointRow.reason).where(WaypointRow.mission_id == live.id))
        assert not [reason for reason in reasons if "its order was ended" in reason]
    await act(service, live.id, "abort")


async def test_a_team_that_moves_as_one_takes_no_orders(service: MissionService) -> None:
    live = await flying(service, survey("a", "b", limits=LIMITS | {"com_range_m": 500.0}), step=1)
    with pytest.raises(ConflictError, match="move as one team"):
        await vehicle_orders.go(live, "a", GoOrder(position=lon_lat(10.0, 10.0)), "Ana")
    # Both may be held: the mission waits for them.
    await hold(live, "a", "Ana")
    await hold(live, "b", "Ana")
    step = live.header.step
    await service.send_on(live, "b", "Ana")
    await until_step(service, live.id, step + 2)
    await act(service, live.id, "abort")


@pytest.mark.slow
async def test_lines_are_as_close_for_vehicles_that_joined_a_draft(service: MissionService) -> None:
    described, joined = survey("a", "b"), survey("a", "b").model_copy(update={"vehicles": []})
    mission = (await service.create(joined)).id
    for vehicle in described.vehicles:
        await service.team_changes.join(await service.get(mission), vehicle, "Ana")
    await act(service, mission, "start")
    await until_step(service, mission, 4)
    other, live = await flying(service, survey("c", "d")), await service.get(mission)
    spacing_m = vehicle_orders.spacing_of(live, live.team.named("a"))
    assert spacing_m == vehicle_orders.spacing_of(other, other.team.named("c"))
