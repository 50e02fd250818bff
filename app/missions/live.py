"""The side of a mission that lives in memory: its map, its journal, its vehicles' reports and its watchers."""

import asyncio
import math
import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
import structlog
from shapely.geometry import Polygon

from app.mapping.georeference import LocalFrame
from app.mapping.tides import TideTable, parse_tid
from app.mapping.types import FloatArray
from app.missions.broadcast import Broadcaster
from app.missions.clock import now
from app.missions.corrections import Corrections
from app.missions.fleet import (
    FleetEvent,
    LinkReport,
    LinkState,
    Position,
    RangeReport,
    ScanReport,
    SoundingReport,
    VehicleInfo,
    VehicleReport,
    WaypointReport,
)
from app.missions.gate import Gate
from app.missions.hub import FleetHub
from app.missions.journal import Counts, Journal
from app.missions.map_builder import BuiltMap, MapBuilder
from app.missions.map_tiles import TileCache
from app.missions.maps import MapSnapshot, MissionFacts
from app.missions.members import Member, Team
from app.missions.position_quality import position_quality
from app.missions.range_journal import RangeJournal
from app.missions.search.scans import report_of, take
from app.missions.search.state import Search
from app.missions.search.views import SearchMessage, progress_of
from app.missions.spec import MissionSpec, VehicleSpec
from app.missions.states import ENDED, MissionState
from app.missions.target_showing import target_views
from app.missions.target_views import TargetView
from app.missions.tracking import Tracking
from app.missions.tracking import warm_up as tracking_warm_up
from app.missions.trails import Trails
from app.missions.views import (
    MapMessage,
    MissionSummary,
    Progress,
    StateMessage,
    TargetsMessage,
    VehiclesMessage,
    VehicleView,
    WaypointsMessage,
    WaypointView,
)
from app.missions.whole_set import WholeSet
from app.storage import events as event_queries
from app.storage import missions as mission_queries
from app.storage import scans as scan_queries
from app.storage import soundings as sounding_queries
from app.storage import stored_maps
from app.storage.database import Database
from app.storage.grouping import Grouped
from app.storage.models import MissionRow, PositionRow, TideTableRow, WaypointRow
from app.storage.sharing import Shared

LIVE_PERIOD_S = 0.2
CROWD, MOST_PERIODS = 20, 5
"""For so many viewers more the period grows by itself once, so many times at most."""
CROWD_MAP_S = 4.0
"""Least time between two maps that a crowd is told of."""
RISES = "rises"
"""Marks events that tell of a vehicle sent up for a fix."""

log = structlog.get_logger(__name__)

Made = TypeVar("Made")


@dataclass
class Header:
    """A mission's state as last committed."""

    state: MissionState
    reason: str
    created_at: Any
    updated_at: Any
    elapsed_s: float
    step: int = 0
    objective: float | None = None
    terms: dict[str, float] | None = None


class LiveMission:
    """One mission in memory. Made by ``load``; the step loop, the service and the watchers share it."""

    def __init__(
        self,
        database: Database,
        hub: FleetHub,
        executor: Executor,
        row: MissionRow,
        spec: MissionSpec,
        counts: Counts,
        tide_table: TideTable | None = None,
        time_scale: float = 1.0,
        search: Search | None = None,
        builder: MapBuilder | None = None,
    ) -> None:
        self.id = row.id
        self.spec = spec
        self.header = Header(MissionState(row.state), row.reason, row.created_at, row.updated_at, row.elapsed_s)
        self.frame: LocalFrame = spec.frame()
        self.area = spec.local_area()
        self.team = Team()
        self.broadcaster = Broadcaster()
        self.builder = builder or builder_of(spec)
        self.margin_m = 2 * spec.limits.max_step_m
        """How far outside the area what vehicles measured still belongs to the mission and helps the map's edge."""
        corrections = Corrections(self.frame, spec.tide, table=tide_table, sound_speed=spec.sound_speed)
        self.gate = self._gate_with(corrections)
        self.reference_m: FloatArray | None = None
        """Depths of the grid that the map is compared with, at the map's cells."""
        self.revision = 0
        """Counts changes of what the map is shown with."""
        self.tiles = TileCache()
        self.trails = Trails(database, row.id)
        self.changed = asyncio.Event()
        """Set whenever a vehicle reported something that the step loop may be waiting for."""
        self.search = search
        """What a mission of kind search knows of its site."""
        take_scans = None if self.search is None else partial(take, self.search, row.id, self.changed.set)
        self.journal = Journal(database, row.id, self.gate, counts, self.broadcaster, self.builder.add, take_scans)
        self.journal.on_trouble = self.publish_summary
        self.whole = WholeSet(database, row.id, self.builder, self.journal)
        """All its soundings, and its map as it is stored."""
        self.ranges = RangeJournal(database, row.id, Tracking(spec, self.frame), self.journal, time_scale)
        """Ranges to moving targets, and what they tell."""
        self.intake: Grouped[Any, Any] | None = None
        """Batches of measurements that wait to be stored together."""
        self.keys_looked_at_s = -math.inf
        """When old idempotency keys were last forgotten, by the loop's clock."""
        self.correcting = asyncio.Lock()
        """Held while corrections change, one after the other."""
        self.halted = False
        """Set while vehicles are being stopped: the step loop must not send them off again as it ends."""
        self.seconds_per_step: float | None = None
        self.running_since_s: float | None = None
        self.database = database
        """What is written through it is refused once another process has the mission."""
        self._hub = hub
        self._time_scale = time_scale
        self._executor = executor
        self._waypoints: dict[str, WaypointView] = {}
        self._places: dict[str, tuple[Position, tuple[float, float] | None]] = {}
        self._ticker: asyncio.Task[None] | None = None
        self._map_news: MapMessage | None = None
        self._map_told_s = -math.inf
        self._search_told = 0
        self.notice_imports = Shared(self._notice_imports)
        """Take up the soundings of logs that the command line imported while this process had the mission."""

    @classmethod
    async def load(
        cls, database: Database, hub: FleetHub, executor: Executor, row: MissionRow, time_scale: float = 1.0
    ) -> "LiveMission":
        """Take a mission up from the database, as it was last committed."""
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
            risings = await event_queries.count_by_vehicle(session, row.id, "surface", RISES)
        # Building the spec checks geometry, which takes milliseconds: not on the event loop.
        loop = asyncio.get_running_loop()
        spec = await loop.run_in_executor(executor, MissionSpec.model_validate, row.spec)
        table = None
        if tide is not None:
            table = await loop.run_in_executor(executor, partial(parse_tid, tide.text, name=tide.name))
        search = None
        if spec.search is not None:
            search = await loop.run_in_executor(executor, Search, spec, spec.search, spec.frame(), time_scale)
        counts = Counts(stored.accepted, stored.rejected)
        # Which cells lie in the area is quick to tell of hundreds, and holds everyone up of millions.
        builder = await asyncio.to_thread(builder_of, spec)
        live = cls(database, hub, executor, row, spec, counts, table, time_scale, search, builder)
        if spec.targets:
            await loop.run_in_executor(executor, tracking_warm_up)
            async with database.reading() as session:
                await live.ranges.load(session, step)
        await live.whole.show(stored, imported=prior, ended=live.header.state in ENDED)
        await live._take_up_search()
        live.reference_m = reference
        live.whole.imports_noticed = imported
        await live.trails.newest()
        live.journal.travelled_m = live.trails.length_m
        if step is not None:
            live.set_step(step.number, step.objective, step.terms)
        for vehicle in vehicles:
            if vehicle.left_at is None:
                member = live.team.join(VehicleSpec.model_validate(vehicle.spec), vehicle.slot)
                member.report = _last_report(positions.get(member.name))
                member.risings = risings.get(member.name, 0)
        live.show_waypoints([live.waypoint_view(waypoint) for waypoint in waypoints])
        return live

    async def _take_up_search(self) -> None:
        """Make the site's grid of every scan that was accepted."""
        if self.search is None:
            return
        async with self.database.reading() as session:
            scans = await scan_queries.accepted_scans(session, self.id)
            self.search.began_at = await mission_queries.first_step_at(session, self.id)
        await self.in_thread(self.search.see, [report_of(row) for row in scans])

    def make_gate(self) -> Gate:
        """Return a gate with the mission's corrections, which has seen no sounding yet."""
        return self._gate_with(self.gate.corrections)

    def _gate_with(self, corrections: Corrections) -> Gate:
        return Gate(corrections, Polygon(self.area), margin_m=self.margin_m, noise=self.spec.sounding_noise)

    async def _notice_imports(self) -> None:
        async with self.database.reading() as session:
            newest = await event_queries.last_event_id(session, self.id, kind="import")
        if newest <= self.whole.imports_noticed:
            return

        async def read() -> Counts:
            async with self.database.reading() as session:
                counted = await sounding_queries.counts(session, self.id)
            self.whole.changed()
            self.whole.imports_noticed = newest
            return Counts(counted.get("accepted", 0), counted.get("rejected", 0))

        await self.journal.count_again(read)
        self.publish_summary()

    def halt(self) -> None:
        """Keep the step loop from sending anything more, and wake everyone who waits for a waypoint."""
        self.halted = True
        for member in self.team:
            member.pursuing = None
        self.changed.set()
        self.publish_summary()

    def set_step(self, number: int, objective: float | None, terms: dict[str, float]) -> None:
        """Note the last committed step."""
        self.header.step = number
        self.header.objective = objective
        self.header.terms = terms
        self.journal.step = number

    def receive(self, event: FleetEvent) -> None:
        """Take an event from one of this mission's vehicles; called from the event loop, never blocks."""
        member = self.team.get(event.vehicle)
        if member is None:
            return
        match event:
            case VehicleReport():
                if self.local_place(event.position) is None:
                    log.warning("position is not near the mission, ignored", vehicle=event.vehicle)
                    return
                member.report = event
                self.journal.position(event)
                if self.spec.targets:
                    self.ranges.times.heard(event.vehicle, event.time_s)
            case SoundingReport():
                self.journal.sounding(event)
                return
            case ScanReport():
                self.journal.scan(event)
                return
            case RangeReport():
                self.ranges.note(event, member.report.time_s if member.report else None)
                return
            case LinkReport():
                member.link = event.state
                if event.state in (LinkState.HEARD, LinkState.READY):
                    # It can be reached but follows nothing of ours (any more): the loop engages it again.
                    member.engaged = False
            case WaypointReport():
                self._receive_waypoint(member, event)
        self.changed.set()

    def _receive_waypoint(self, member: Member, event: WaypointReport) -> None:
        if event.mission_id != self.id or member.order is None or event.step != member.order.step:
            return
        member.status = event.status
        member.reason = event.reason
        self.journal.waypoint(event)
        shown = self._waypoints.get(member.name)
        if shown is not None and shown.step == event.step:
            update = {"status": event.status, "reason": event.reason}
            self.show_waypoints([shown.model_copy(update=update)])

    def show_waypoints(self, waypoints: list[WaypointView]) -> None:
        """Make these the vehicles' newest waypoints and tell everyone who watches."""
        if waypoints:
            self._waypoints |= {waypoint.vehicle: waypoint for waypoint in waypoints}
            self.broadcaster.publish(WaypointsMessage(waypoints=waypoints))

    @property
    def waypoints(self) -> list[WaypointView]:
        """The newest waypoint of each vehicle."""
        return list(self._waypoints.values())

    def waypoint_of(self, vehicle: str) -> WaypointView | None:
        """Return a vehicle's newest waypoint."""
        return self._waypoints.get(vehicle)

    def waypoint_view(self, row: WaypointRow) -> WaypointView:
        """Return a stored waypoint as it is shown."""
        return WaypointView.model_validate(
            {
                "vehicle": row.vehicle,
                "step": row.step,
                "lat_deg": row.lat_deg,
                "lon_deg": row.lon_deg,
                "east_m": row.east_m,
                "north_m": row.north_m,
                "depth_m": row.depth_m,
                "speed_mps": self.spec.speed_mps,
                "arrival_radius_m": self.spec.arrival_radius_m,
                "min_altitude_m": self.spec.limits.min_altitude_m,
                "status": row.status,
                "reason": row.reason,
            }
        )

    async def build_map(self) -> BuiltMap | None:
        """Make the map of everything accepted so far as thoroughly as for a product, in a worker thread."""
        await self.whole.complete()
        before = self.builder.newest
        built = await self.in_thread(partial(self.builder.build, thorough=True))
        if built is not None and built is not before:
            self.publish_map(built)
        return built

    async def map_what_is_stored(self) -> None:
        """Make the map of a mission that was just taken up, and tell everyone who watches how far it has come."""
        if self.builder.stale:
            await self.build_map()
            self.publish_summary()
            await self.whole.keep(self.header.step, ended=self.header.state in ENDED)

    async def in_thread(self, work: Callable[..., Made], *arguments: Any) -> Made:
        """Compute something in a worker thread."""
        return await asyncio.get_running_loop().run_in_executor(self._executor, work, *arguments)

    @property
    def facts(self) -> MissionFacts:
        """Return what every product states."""
        return MissionFacts(self.id, self.spec, self.frame, self.gate.corrections.vertical_datum)

    def show_reference(self, depths_m: FloatArray | None) -> None:
        """Compare the map with these depths at its cells, or with nothing."""
        self.reference_m = depths_m
        self.revision += 1

    def snapshot(self, built: BuiltMap) -> MapSnapshot:
        """Return a map with what is needed to understand it."""
        step = self.whole.step_of(built, self.header.step)
        return MapSnapshot(self.facts, built, step, self.reference_m, self.revision)

    def publish_map(self, built: BuiltMap) -> None:
        """Tell everyone who watches that there is a new map."""
        depth = built.map.depth_m[np.isfinite(built.map.depth_m)]
        self._map_news = MapMessage(
            version=built.version,
            step=self.header.step,
            min_depth_m=float(depth.min()) if depth.size else None,
            max_depth_m=float(depth.max()) if depth.size else None,
        )
        self._tell_of_map()

    def _tell_of_map(self) -> None:
        """Publish what is new of the map; to a crowd, who would all fetch it, not before it is time again."""
        wait_s = 0.0 if self.broadcaster.viewers < CROWD else CROWD_MAP_S
        if self._map_news is not None and time.monotonic() - self._map_told_s >= wait_s:
            self.broadcaster.publish(self._map_news)
            self._map_news, self._map_told_s = None, time.monotonic()

    def _tell_of_search(self) -> None:
        """Publish how a search stands when a scan changed that."""
        found = progress_of(self.search, self.team, self.frame)
        if found is not None and found.version != self._search_told:
            self._search_told = found.version
            self.broadcaster.publish(SearchMessage(search=found))

    def figures(self) -> dict[str, float]:
        """Return how far the mission has come, as each step keeps it."""
        built = self.builder.newest
        found = {
            "coverage_pct": self.builder.coverage_pct(),
            "remaining_pct": self.builder.remaining_pct(),
            "distance_m": self.journal.travelled_m,
        }
        return found | ({} if built is None else {"mean_sd_m": built.mean_sd_m})

    def progress(self) -> Progress:
        """Return how far the mission has come."""
        built = self.builder.newest
        header = self.header
        loop_time = asyncio.get_running_loop().time()
        running_s = loop_time - self.running_since_s if self.running_since_s is not None else 0.0
        return Progress(
            step=header.step,
            steps=self.spec.steps,
            soundings=self.journal.counts.accepted,
            rejected=self.journal.counts.rejected,
            distance_m=self.journal.travelled_m,
            coverage_pct=self.builder.coverage_pct(),
            remaining_pct=self.builder.remaining_pct(),
            mean_sd_m=built.mean_sd_m if built is not None else None,
            objective=header.objective,
            terms=header.terms or {},
            elapsed_s=header.elapsed_s + running_s,
            eta_s=self._eta_s(),
            search=progress_of(self.search, self.team, self.frame),
        )

    def _eta_s(self) -> float | None:
        """Return how long the mission still takes, wall-clock seconds; a search as long as its time window lasts."""
        if self.search is not None:
            return max(self.search.left_s(), 0.0) / self._time_scale
        if self.seconds_per_step is None:
            return None
        return (self.spec.steps - self.header.step) * self.seconds_per_step

    def summary(self) -> MissionSummary:
        """Return the mission as it stands in a list."""
        header = self.header
        return MissionSummary(
            id=self.id,
            name=self.spec.name,
            state=header.state,
            reason=self._why_it_waits() or header.reason,
            created_at=header.created_at,
            updated_at=header.updated_at,
            progress=self.progress(),
        )

    def _why_it_waits(self) -> str:
        trouble = self.journal.storage.trouble
        if not trouble:
            return ""
        waits = "; the vehicles wait at their waypoints" if self.header.state is MissionState.RUNNING else ""
        return f"nothing can be written down: {trouble}{waits}"

    def publish_summary(self) -> None:
        """Tell everyone who watches about state and progress."""
        self.broadcaster.publish(StateMessage(mission=self.summary()))

    def vehicle_views(self) -> list[VehicleView]:
        """Return the vehicles that take part."""
        infos = self._hub.infos()
        return [self._vehicle_view(member, infos.get(member.key)) for member in self.team]

    def vehicle_view(self, info: VehicleInfo) -> VehicleView | None:
        """Return a vehicle of this name and kind, if it takes part."""
        member = self.team.get(info.name)
        return None if member is None or member.key != (info.kind, info.name) else self._vehicle_view(member, info)

    def target_views(self) -> list[TargetView]:
        """Return the moving targets, foretold for now."""
        pursuers = {member.pursuing: member.name for member in self.team if member.pursuing is not None}
        return target_views(self.ranges.tracking, self.frame, self.area, self.ranges.times.now_s(), pursuers)

    def _vehicle_view(self, member: Member, info: VehicleInfo | None) -> VehicleView:
        info = info or self._hub.info(member.key)
        report = member.report or info.report
        view = VehicleView(
            name=member.name,
            kind=member.spec.kind,
            sensor=member.spec.sensor,
            mission_id=self.id,
            link=info.state,
            reason=member.refusal or info.reason,
            age_s=rounded(info.age_s, 2),
            address=info.address,
            imc_id=info.imc_id,
            surfacing=member.surfacing,
            risings=member.risings,
            pursuing=member.pursuing,
        )
        if report is None:
            return view
        position = report.position
        known = self._places.get(member.name)
        if known is None or known[0] is not position:
            # It is shown far more often than it moves.
            known = self._places[member.name] = position, self.local_place(position)
        place = known[1]
        return view.model_copy(
            update={
                # No more digits than mean anything: this goes to every viewer several times a second.
                "lat_deg": round(position.lat_deg, 8),
                "lon_deg": round(position.lon_deg, 8),
                "east_m": place and round(place[0], 3),
                "north_m": place and round(place[1], 3),
                "depth_m": round(position.depth_m, 3),
                "altitude_m": rounded(report.altitude_m, 3),
                "heading_deg": rounded(report.heading_rad and math.degrees(report.heading_rad) % 360, 2),
                "speed_mps": rounded(report.speed_mps, 3),
                "battery_pct": rounded(report.battery_pct, 2),
                "position_sd_m": rounded(report.position_sd_m, 3),
                "localization": position_quality(report.position_sd_m, self.spec.surface_policy),
            }
        )

    def local_place(self, position: Position) -> tuple[float, float] | None:
        """Return east and north of a position; None when it is not near enough to be on the mission's frame."""
        try:
            east, north = self.frame.to_local(position.lat_deg, position.lon_deg)
        except ValueError:
            return None
        return float(east), float(north)

    def start_ticker(self) -> None:
        """Send the vehicles' positions at a steady rate while anyone watches."""
        if self._ticker is None or self._ticker.done():
            self._ticker = asyncio.create_task(self._tick())

    async def _tick(self) -> None:
        while self.broadcaster.watched:
            self.broadcaster.publish(VehiclesMessage(time=now(), vehicles=self.vehicle_views()))
            if self.spec.targets:
                self.broadcaster.publish(TargetsMessage(time=now(), targets=self.target_views()))
            self._tell_of_search()
            self._tell_of_map()
            await asyncio.sleep(live_period_s(self.broadcaster.viewers))

    def abandon(self) -> None:
        """Write nothing any more, and send everyone who watches to the process that has the mission now."""
        if self._ticker is not None:
            self._ticker.cancel()
        self.ranges.abandon()
        self.journal.abandon()
        self.broadcaster.end("another process has the mission now")

    async def close(self) -> None:
        """Write what is left."""
        if self._ticker is not None:
            self._ticker.cancel()
            await asyncio.gather(self._ticker, return_exceptions=True)
        await self.ranges.close()
        await self.journal.close()
        await self.whole.close(self.header.step)


def builder_of(spec: MissionSpec) -> MapBuilder:
    """Return the builder of a mission's map, which knows of no sounding yet."""
    return MapBuilder(spec.local_area(), spec.cell_m, spec.accuracy_m)


def live_period_s(viewers: int) -> float:
    """Return how often positions are sent: a crowd of viewers sees them less often, so that it costs hardly more."""
    return LIVE_PERIOD_S * min(MOST_PERIODS, 1.0 + viewers // CROWD)


def rounded(value: float | None, digits: int) -> float | None:
    """Return a value with so many decimals; None stays."""
    return None if value is None else round(value, digits)


def _last_report(row: PositionRow | None) -> VehicleReport | None:
    """Return where a vehicle was last: one that holds there and only polls has nothing new to tell."""
    if row is None:
        return None
    return VehicleReport(row.vehicle, row.time_s, Position(row.lat_deg, row.lon_deg, row.depth_m))
