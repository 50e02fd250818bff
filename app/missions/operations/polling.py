"""Waypoints for vehicles that ask for them."""

import asyncio
from collections.abc import Callable

from app.missions.errors import ConflictError, InvalidRequestError, VehicleNotFoundError
from app.missions.fleet.interface import WaypointStatus
from app.missions.live.mission import LiveMission
from app.missions.spec.failsafes import Response
from app.missions.states import MissionState
from app.missions.team import Member, Withdrawal
from app.missions.views.mission import WaypointView


async def waypoint(
    live: LiveMission, vehicle: str, *, after_step: int | None = None, timeout_s: float = 0.0
) -> WaypointView | None:
    """Return a vehicle's waypoint when it is newer than ``after_step``, waiting for it; None when none came.

    A polling vehicle acknowledges the waypoint by this. Raises ConflictError when it must stop, or stay where it is,
    InvalidRequestError when there is no ``after_step`` yet.
    """
    member = live.team.get(vehicle)
    if member is None:
        for polled in live.hub.polled.values():
            polled.told_to_stop(vehicle, live.id)
        raise VehicleNotFoundError(
            f"vehicle {vehicle!r} takes no part in this mission", "stop; nothing more comes from here for it"
        )
    link = live.hub.polled.get(member.spec.kind)
    after = -1 if after_step is None else after_step

    def newer() -> WaypointView | None:
        shown = live.waypoints.of(vehicle)
        ready = shown is not None and shown.step > after and shown.status is not WaypointStatus.PLANNED
        return shown if ready and member.ordered else None

    def must_stop() -> bool:
        waits = live.header.state is MissionState.READY or (
            live.header.state is MissionState.RUNNING and not live.flight.halted
        )
        return not waits or live.team.get(vehicle) is None

    def settled() -> bool:
        return newer() is not None or must_stop() or _staying(member) is not None

    if not must_stop() and _staying(member) is None:
        _check_given(live, vehicle, after)
    if link is not None:
        link.has_waypoint(vehicle, after)
    await _wait_watching(live, settled, timeout_s)
    if must_stop():
        if link is not None:
            link.told_to_stop(vehicle, live.id)
        state = live.header.state if live.team.get(vehicle) is not None else "without this vehicle"
        state = "ending" if state is MissionState.RUNNING else state
        raise ConflictError(f"the mission is {state}: stop and hold", "ask again after it was started or resumed")
    if (withdrawal := _staying(member)) is not None:
        if link is not None:
            if withdrawal.over or withdrawal.response is Response.STOP:
                link.told_to_stop(vehicle, live.id)
            else:
                link.told_to_wait(vehicle)
        raise ConflictError(f"{vehicle!r} stays where it is ({withdrawal.why}): stop and hold", "ask again later")
    found = newer()
    if found is not None and link is not None:
        link.has_waypoint(vehicle, found.step)
        found = live.waypoints.of(vehicle)
    way_m = member.way_home.left_alone_m
    if found is None or way_m is None:
        return found
    lats, lons = live.frame.to_geographic(way_m[:, 0], way_m[:, 1])
    way = [(float(lon), float(lat)) for lat, lon in zip(lats, lons, strict=True)]
    return found.model_copy(update={"way_home": way})


def _check_given(live: LiveMission, vehicle: str, after: int) -> None:
    """Raise InvalidRequestError where a vehicle says that it has a step that it was never given."""
    shown = live.waypoints.of(vehicle)
    newest = 0 if shown is None else shown.step
    if after > newest:
        words = f"the newest is {newest}" if newest else "it was given none yet"
        raise InvalidRequestError(
            "after_step",
            f"{vehicle!r} has no waypoint of step {after}: {words}",
            "send the step of the newest waypoint that it fetched in this mission, or leave after_step out",
        )


def _staying(member: Member) -> Withdrawal | None:
    """Return why a vehicle is to stay where it is: it is held, waits on its way home, or is where that led."""
    found = member.withdrawal
    if found is None or found.over or found.below or found.response in (Response.HOLD, Response.STOP):
        return found
    return None


async def _wait_watching(live: LiveMission, condition: Callable[[], bool], timeout_s: float) -> None:
    """Wait until the condition holds or the time is over, looking again at every live message."""
    if condition() or timeout_s <= 0:
        return
    with live.broadcaster.subscribe() as subscription:

        async def until_it_holds() -> None:
            async for _message in subscription:
                if condition():
                    return

        try:
            await asyncio.wait_for(until_it_holds(), timeout_s)
        except TimeoutError:
            return
