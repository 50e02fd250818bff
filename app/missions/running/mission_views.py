"""What is answered about missions, and about vehicles that take part in none."""

import inspect
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

from app import __version__
from app.exploration.planner.base import PlannerBase
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import COVERERS, INSTALLED, PLANNERS, options_of
from app.missions.fleet.interface import StopReceipt, VehicleInfo
from app.missions.live.mission import LiveMission
from app.missions.live.watchers.broadcast import Subscription
from app.missions.running.supervisor import receipt
from app.missions.spec.vehicle import VehicleKind
from app.missions.views.messages import LiveMessage, SnapshotMessage
from app.missions.views.mission import ActionView, MissionView, PlannerView, StopView, VehicleView
from app.storage.queries import events as event_queries


def mission_view(live: LiveMission) -> MissionView:
    """Return a mission as it stands, with its vehicles, waypoints and targets."""
    frame = live.frame
    # All of it was checked when it was made.
    return MissionView.model_construct(
        **dict(live.summary()),
        spec=live.spec,
        origin=(frame.origin_lon_deg, frame.origin_lat_deg),
        vehicles=live.vehicles.all(),
        waypoints=live.waypoints.newest,
        current=live.vehicles.current(),
        targets=live.target_views(),
        has_reference=live.map.reference_m is not None,
    )


def action_view(live: LiveMission, stops: Sequence[StopReceipt]) -> ActionView:
    """Return what an action led to, and what each vehicle answered that was stopped."""
    return ActionView(mission=live.summary(), stops=[StopView(**receipt(stop)) for stop in stops])


@asynccontextmanager
async def watched(live: LiveMission) -> AsyncIterator[AsyncIterator[LiveMessage]]:
    """Yield live messages, the first of them a snapshot. A watcher that is too slow loses only positions."""
    with live.broadcaster.subscribe() as subscription:
        live.feed.start()
        yield _beginning_with(await _snapshot_message(live), subscription)


@asynccontextmanager
async def followed(live: LiveMission) -> AsyncIterator[tuple[int, Subscription]]:
    """Yield the id of the newest log entry, 0 without one, and the live messages that come after it."""
    with live.broadcaster.subscribe() as subscription:
        live.feed.start()
        yield await _last_event_id(live), subscription


async def _snapshot_message(live: LiveMission) -> SnapshotMessage:
    """Return everything that is needed to draw the picture of a mission."""
    tracks = await live.trails.newest()
    last_event_id = await _last_event_id(live)
    built = live.builder.newest
    return SnapshotMessage(
        mission=mission_view(live),
        tracks=tracks,
        map_version=built.version if built else 0,
        last_event_id=last_event_id,
        alarms=live.journal.alarms.open,
    )


async def _last_event_id(live: LiveMission) -> int:
    async with live.database.reading() as session:
        return await event_queries.last_event_id(session, live.id)


async def _beginning_with(first: LiveMessage, rest: Subscription) -> AsyncIterator[LiveMessage]:
    """Yield the first message, then all that follow."""
    yield first
    async for message in rest:
        yield message


def idle_vehicle_view(info: VehicleInfo) -> VehicleView:
    """Return a vehicle that takes part in no mission, as its link knows it."""
    report = info.report
    return VehicleView(
        name=info.name,
        kind=VehicleKind(info.kind),
        link=info.state,
        reason=info.reason,
        age_s=info.report_age_s,
        address=info.address,
        imc_id=info.imc_id,
        lat_deg=report.position.lat_deg if report else None,
        lon_deg=report.position.lon_deg if report else None,
        depth_m=report.position.depth_m if report else None,
        altitude_m=report.altitude_m if report else None,
        speed_mps=report.speed_mps if report else None,
        battery_pct=report.battery_pct if report else None,
    )


def planner_views() -> list[PlannerView]:
    """Return the planners that a mission may name, and those that are installed and cannot be used."""
    usable = [
        PlannerView(
            name=name,
            summary=_summary(kind),
            package=INSTALLED.packages.get(name, f"bathyfleet {__version__}"),
            options=_options(kind),
        )
        for name, kind in (PLANNERS | COVERERS).items()
    ]
    broken = [
        PlannerView(name=planner.name, summary="", package=planner.package, problem=planner.reason, options={})
        for planner in INSTALLED.broken.values()
        if planner.name not in PLANNERS | COVERERS
    ]
    return usable + broken


def _options(kind: type[PlannerBase]) -> dict[str, Any]:
    """Return the JSON schema of the options that a planner reads."""
    schema = PlannerOptions.model_json_schema()
    read = options_of(kind)
    return schema | {"properties": {name: one for name, one in schema["properties"].items() if name in read}}


def _summary(kind: type[object]) -> str:
    return (inspect.getdoc(kind) or "").partition("\n\n")[0].replace("\n", " ")
