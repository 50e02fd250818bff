"""Takes a mission up from the database, as it was last committed."""

import asyncio
from dataclasses import replace
from functools import partial

from app.mapping.water.tide_files import parse_tid
from app.missions.alarm_kinds import AlarmKind
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import Position, VehicleReport
from app.missions.flown import Flown
from app.missions.live.header import StoredMission
from app.missions.live.journals.journal import RISES, Counts
from app.missions.live.mission import LiveMission, builder_of
from app.missions.live.threads import Threads
from app.missions.search.scan_log import report_of
from app.missions.search.state import Search
from app.missions.soundings.adjustment import TrackAdjustment
from app.missions.soundings.beam_edits import edit_of
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleSpec
from app.missions.states import AT_SEA, ENDED
from app.missions.targets.filters import warm_up as tracking_warm_up
from app.missions.team import Withdrawal
from app.storage.database import Database
from app.storage.models import AdjustmentRow, MissionRow, PositionRow, TideTableRow
from app.storage.ping_files import PingFiles
from app.storage.queries import alarms as alarm_queries
from app.storage.queries import events as event_queries
from app.storage.queries import missions as mission_queries
from app.storage.queries import pings as ping_queries
from app.storage.queries import scans as scan_queries
from app.storage.queries import soundings as sounding_queries
from app.storage.queries import stored_maps
from app.storage.queries import telemetry as telemetry_queries


async def take_up(
    database: Database,
    hub: FleetHub,
    threads: Threads,
    row: MissionRow,
    ping_files: PingFiles,
    time_scale: float = 1.0,
) -> LiveMission:
    """Return the mission of a row, with its vehicles, its newest waypoints, its map and how far it had come."""
    async with database.reading() as session:
        imported = await event_queries.last_event_id(session, row.id, kind="import")
        stored = await stored_maps.stored_map(session, row.id, imported)
        prior = await sounding_queries.any_imported(session, row.id)
        vehicles = await mission_queries.vehicles_of(session, row.id)
        waypoints = await mission_queries.newest_waypoints(session, row.id)
        step = await mission_queries.last_step(session, row.id)
        positions = await mission_queries.last_positions(session, row.id)
        reference = await sounding_queries.reference_grid(session, row.id)
        tide = await session.get(TideTableRow, row.id)
        drift = await session.get(AdjustmentRow, row.id)
        edited = await ping_queries.beam_edits(session, row.id)
        heard = await telemetry_queries.last_heard(session, row.id)
        batteries = await telemetry_queries.last_batteries(session, row.id)
        standing = await alarm_queries.standing(session, row.id) if row.state in AT_SEA else []
        risings = await event_queries.count_by_vehicle(session, row.id, "surface", RISES)
    # Building the spec checks geometry, which takes milliseconds: not on the event loop.
    loop = asyncio.get_running_loop()
    spec = await loop.run_in_executor(threads.planning, stored_spec, row)
    table = None
    if tide is not None:
        table = await loop.run_in_executor(threads.planning, partial(parse_tid, tide.text, name=tide.name, stored=True))
    adjustment = None
    if drift is not None:
        adjustment = await loop.run_in_executor(threads.planning, TrackAdjustment.unpack, drift.content)
    edits = {one.id: await loop.run_in_executor(threads.planning, edit_of, one) for one in edited}
    search = None
    if spec.search is not None:
        search = await loop.run_in_executor(threads.planning, Search, spec, spec.search, spec.frame(), time_scale)
    counts = Counts(stored.accepted, stored.rejected)
    # Which cells lie in the area is quick to tell of hundreds, and holds everyone up of millions.
    builder = await asyncio.to_thread(builder_of, spec)
    described = [VehicleSpec.model_validate(vehicle.spec) for vehicle in vehicles]
    mountings = {one.name: one.mounting for one in described}
    mission = StoredMission(row, spec, counts, table, adjustment, mountings, edits)
    live = LiveMission(database, hub, threads, ping_files, time_scale, mission, search, builder)
    async with database.reading() as session:
        pinged = await live.pings.open(session)
    live.journal.alarms.recall(standing)
    live.boundaries.recall(live.journal.alarms.standing([AlarmKind.ZONE_ENTERED, AlarmKind.AREA_LEFT]))
    live.journal.counts = replace(counts, pings=pinged.pings, beams=pinged.beams, rejected_pings=pinged.rejected)
    if spec.targets:
        await loop.run_in_executor(threads.planning, tracking_warm_up)
        async with database.reading() as session:
            await live.ranges.load(session, step)
    await live.stored_soundings.show(stored, imported, imported=prior, ended=live.header.state in ENDED)
    if search is not None:
        await _take_up_search(live, search)
    live.map.show_reference(reference)
    await live.trails.newest()
    live.journal.travelled_m = live.trails.length_m
    if step is not None:
        live.set_step(step.number, step.objective, step.terms)
    for vehicle, vehicle_spec in zip(vehicles, described, strict=True):
        member = live.team.join(vehicle_spec, vehicle.slot)
        ended = live.header.state in ENDED
        level_pct = batteries.get(member.name)
        member.report = _last_report(positions.get(member.name), level_pct if ended else None)
        member.heard_s = heard.get(member.name)
        member.stored_battery_pct = level_pct
        member.fixes.risings = risings.get(member.name, 0)
        member.flown = Flown.recall(vehicle.flown)
        member.energy.used_s = member.flown.used_s
        member.withdrawal = Withdrawal.recall(vehicle.withdrawal)
        if ended:
            member.energy.take_level(level_pct)
            member.come_to_rest()
        if vehicle.left_at is not None:
            live.team.leave(member.name, vehicle.left_at)
    live.waypoints.show_rows(waypoints)
    return live


def stored_spec(row: MissionRow) -> MissionSpec:
    """Return what a stored mission is to do. Raises ValueError.

    Blank names and those of several lines were taken once: such a mission is called by its words, or by its id.
    """
    name = " ".join(str(row.spec.get("name", "")).split())
    return MissionSpec.model_validate(row.spec | {"name": name or row.id})


async def _take_up_search(live: LiveMission, search: Search) -> None:
    """Make the site's grid of every scan that was accepted."""
    async with live.database.reading() as session:
        scans = await scan_queries.accepted_scans(session, live.id)
        search.began_at = await mission_queries.first_step_at(session, live.id)
    await live.in_thread(search.see, [report_of(row) for row in scans])


def _last_report(row: PositionRow | None, level_pct: float | None) -> VehicleReport | None:
    """Return where a vehicle was last, and its battery's level where that is to be shown still.

    One that holds there and only polls has nothing new to tell.
    """
    if row is None:
        return None
    position = Position(row.lat_deg, row.lon_deg, row.depth_m)
    return VehicleReport(row.vehicle, row.time_s, position, battery_pct=level_pct)
