"""The side of a mission that lives in memory: its map, its journal, its vehicles' reports and its watchers."""

import asyncio
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime
from functools import partial
from typing import Any, TypeVar

import numpy as np
from shapely.geometry import Polygon

from app.arrays import FloatArray
from app.compute.compute import Compute
from app.estimation import Sensor, SingleBeam
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.pings import Pings, reach_m
from app.missions.errors import ConflictError
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import FleetEvent, VehicleReport
from app.missions.live.boundaries import Boundaries
from app.missions.live.header import Ending, MissionHeader, StoredMission
from app.missions.live.journals.journal import Counts, Journal
from app.missions.live.journals.range_journal import RangeJournal
from app.missions.live.journals.swath_intake import SwathIntake
from app.missions.live.progress import figures, progress, search_progress, summary
from app.missions.live.ships import ShipsAbout
from app.missions.live.sounding_store import SoundingStore
from app.missions.live.threads import Threads
from app.missions.live.trails import Trails
from app.missions.live.vehicle_reports import VehicleReports
from app.missions.live.watchers.broadcast import Broadcaster
from app.missions.live.watchers.feed import LiveFeed
from app.missions.live.watchers.vehicles import VehicleViews
from app.missions.live.watchers.waypoints import WaypointViews
from app.missions.maps.builder import HEAVY, BuiltMap, MapBuilder
from app.missions.maps.live_grid import map_of
from app.missions.maps.snapshot import NOT_MADE, MapSnapshot, MissionFacts
from app.missions.maps.tiles import TileCache
from app.missions.pings.gate import PingGate
from app.missions.pings.store import PingStore
from app.missions.recovery.energy import Energy
from app.missions.search.mates import Mates
from app.missions.search.scan_log import take
from app.missions.search.state import Search
from app.missions.soundings.beam_edits import BeamEdit, rulings_of
from app.missions.soundings.corrections import Corrections
from app.missions.soundings.gate import Gate
from app.missions.spec.budget import Budget
from app.missions.spec.failsafes import Response
from app.missions.spec.mission import MissionSpec
from app.missions.spec.mounting import MountingSpec
from app.missions.spec.vehicle import Sensor as SensorName
from app.missions.spec.vehicle import VehicleSpec
from app.missions.states import ENDED, MissionState
from app.missions.targets.filters import TargetFilters
from app.missions.targets.views import target_views
from app.missions.team import Member, Swath, Team, Withdrawal, WithdrawalCause
from app.missions.views.messages import StateMessage
from app.missions.views.mission import MissionSummary, Progress
from app.missions.views.targets import TargetView
from app.storage.concurrency.single_flight import Shared
from app.storage.database import Database
from app.storage.ping_files import PingFiles
from app.storage.queries import events as event_queries
from app.storage.queries import soundings as sounding_queries

Made = TypeVar("Made")
Part = TypeVar("Part")


class LiveMission:
    """One mission in memory. Made by ``take_up``; the flight, the service and the watchers share it."""

    def __init__(
        self,
        database: Database,
        hub: FleetHub,
        threads: Threads,
        ping_files: PingFiles,
        time_scale: float,
        stored: StoredMission,
        search: Search | None,
        builder: MapBuilder,
    ) -> None:
        """Make a mission of what is stored. One function because it is the list of what a mission in memory has."""
        row, spec = stored.row, stored.spec
        self.id = row.id
        self.spec = spec
        self.header = MissionHeader(MissionState(row.state), row.reason, row.created_at, row.updated_at, row.elapsed_s)
        self.frame: LocalFrame = spec.frame()
        self.area = spec.local_area()
        self.hub = hub
        """All links, those to its vehicles among them."""
        self.team = Team(hub.capabilities, self._energy_of)
        self.broadcaster = Broadcaster()
        self.builder = builder
        self.compute: Compute | None = None
        """Who does heavy work; None: this process alone."""
        self.margin_m = 2 * spec.limits.max_step_m
        """How far outside the area what vehicles measured still belongs to the mission and helps the map's edge."""
        corrections = Corrections.of(
            spec, self.frame, stored.tide_table, stored.adjustment, stored.mountings, rulings_of(stored.beam_edits)
        )
        self.beam_edits = dict(stored.beam_edits)
        """What operators said of beams, by number, in the order in which they said it."""
        self.stated_mountings = dict(stored.mountings)
        """How its vehicles, also those that left, say that their sonars are mounted."""
        self.gate = self._gate_with(corrections)
        self.reference_m: FloatArray | None = None
        """Depths of the grid that the map is compared with, at the map's cells."""
        self.revision = 0
        """Counts changes of what the map is shown with."""
        self.tiles = TileCache()
        self.trails = Trails(database, row.id)
        self.changed = asyncio.Event()
        """Set whenever a vehicle reported something that the flight may be waiting for."""
        self.search = search
        """What a mission of kind search knows of its site."""
        self.pings = PingStore(database, row.id, PingGate(self.frame, self.gate.outside), ping_files)
        """All its pings."""
        self.builder.swath.place = corrections.placing()
        self._mates = None if search is None else Mates(self.team, lambda m: hub.info(m.key).report, spec, self.frame)
        take_scans = (
            None
            if search is None or self._mates is None
            else partial(take, search, self._mates, row.id, self.changed.set)
        )
        self.journal = Journal(
            database,
            row.id,
            self.gate,
            stored.counts,
            self.broadcaster,
            self._take_soundings,
            self.pings,
            self._take_pings,
            self.publish_summary,
            take_scans,
        )
        self.swath = SwathIntake(self.builder.swath, self.pings, self.journal)
        """Pings on their way into the map."""
        self.stored_soundings = SoundingStore(database, row.id, self.builder, self.journal)
        """All its soundings, and its map as it is stored."""
        self.ranges = RangeJournal(database, row.id, TargetFilters(spec, self.frame), self.journal, time_scale)
        """Ranges to moving targets, and what they tell."""
        self.correcting = asyncio.Lock()
        """Held while corrections change, one after the other."""
        self._placed_files: list[tuple[str, str]] = []
        """Vehicles, and multibeams' own files of them that are being read."""
        self.fitted_budget = spec.budget
        """The length that the legs which vehicles have ahead fit into."""
        self.flown_out = False
        """Whether its flight came to its end: nothing changes any more how long it is."""
        self.ending = Ending.recall(row.ending)
        """What it becomes once all vehicles are home; None while it goes on."""
        self.halted = False
        """Set while vehicles are being stopped: the flight must not send them off again as it ends."""
        self.standstill = ""
        """Why no vehicle may be sent anywhere now; empty while at least one may."""
        self.running_since_s: float | None = None
        self._counting = False
        """Whether what vehicles fly is counted: while the flight goes on, until that is stored at its end."""
        self.database = database
        """What is written through it is refused once another process has the mission."""
        self.waypoints = WaypointViews(lambda: self.spec, self.team, self.broadcaster)
        self.boundaries = Boundaries(self.area, [spec.to_local(zone) for zone in spec.keep_out])
        self.vehicles = VehicleViews(
            row.id, lambda: self.spec, self.frame, hub, self.team, self.boundaries.breach, time_scale
        )
        targets = self.target_views if spec.targets else None
        self.reports = VehicleReports(
            row.id,
            self.frame,
            self.team,
            self.header,
            self.journal,
            self.ranges,
            self.boundaries,
            self.waypoints,
            self.changed,
            time_scale,
        )
        self._measured_late: Callable[[], None] = _nothing
        self.ships = ShipsAbout(row.id, lambda: self.spec, self.frame, self.team, time_scale)
        """Ships near the mission."""
        self.feed = LiveFeed(
            self.broadcaster, self.vehicles.message, targets, partial(search_progress, self), self.ships.message
        )
        self.time_scale = time_scale
        self._threads = threads
        self._parts: dict[Callable[[LiveMission], Any], Any] = {}
        self.notice_imports = Shared(self._notice_imports)
        """Count anew where logs were taken in, by the command line as well, or taken back since that was last done."""

    @contextmanager
    def reading_placed(self, file: str, vehicle: str) -> Iterator[None]:
        """Note that a multibeam's own file is being read, whose beams come placed."""
        self._placed_files.append((vehicle, file))
        try:
            yield
        finally:
            self._placed_files.remove((vehicle, file))

    def placed_files_being_read(self, vehicle: str) -> set[str]:
        """Return the multibeam's own files of a vehicle that are being read."""
        return {file for own, file in self._placed_files if own == vehicle}

    def part(self, kind: Callable[["LiveMission"], Part]) -> Part:
        """Return the mission's own object of a class, made of the mission when it is first asked for."""
        if kind not in self._parts:
            self._parts[kind] = kind(self)
        found: Part = self._parts[kind]
        return found

    def make_gate(self) -> Gate:
        """Return a gate with the mission's corrections, which has seen no sounding yet."""
        return self._gate_with(self.gate.corrections)

    def _gate_with(self, corrections: Corrections) -> Gate:
        return Gate(corrections, Polygon(self.area), margin_m=self.margin_m, noise=self.spec.sounding_noise)

    async def _notice_imports(self) -> None:
        async with self.database.reading() as session:
            newest = await event_queries.last_event_id(session, self.id, kind="import")
        if newest <= self.stored_soundings.imports_noticed:
            return

        async def read() -> Counts:
            async with self.database.reading() as session:
                counted = await sounding_queries.counts(session, self.id)
                before = self.pings.taken_back
                pinged = await self.pings.open(session)
            if self.pings.taken_back != before:
                await self.trails.read_again()
            self.stored_soundings.changed(newest_import=newest)
            self.swath.correct(self.gate.corrections)
            return Counts(
                counted.get("accepted", 0), counted.get("rejected", 0), pinged.pings, pinged.beams, pinged.rejected
            )

        await self.journal.count_again(read)
        self.publish_summary()
        self._note_late_change()

    def _note_late_change(self) -> None:
        if self.header.state in ENDED:
            self._measured_late()

    @property
    def has_swath_sonars(self) -> bool:
        """Whether pings came, or can come."""
        carried = any(member.spec.sensor is SensorName.MULTIBEAM for member in self.team)
        return carried or self.journal.counts.pings > 0

    @property
    def running(self) -> bool:
        """Whether its flight goes on in this process."""
        return self.running_since_s is not None

    def flight_begins(self) -> None:
        """Note that its flight goes on in this process from now on."""
        self.running_since_s = asyncio.get_running_loop().time()
        self._counting = True
        self.flown_out = False
        self.call_everybody_home()

    def count_elapsed(self, seconds: float) -> None:
        """Count seconds of its flight that are stored now."""
        if self.running_since_s is not None:
            self.running_since_s += seconds
        self.header.elapsed_s += seconds

    def stop_counting(self) -> None:
        """Count nothing any more of what vehicles fly: what is stored now is what was flown."""
        self._counting = False

    def flight_ends(self) -> None:
        """Note that nobody flies it here any more."""
        self.running_since_s = None
        self.standstill = ""
        for member in self.team:
            member.come_to_rest()

    def stand_still(self, why: str) -> None:
        """Note why no vehicle may be sent anywhere; empty: at least one may again."""
        self.standstill = why
        if why:
            self.publish_summary()

    def survey_late_changes(self, survey: Callable[[], None]) -> None:
        """Have this called when what was measured changes after the mission has ended."""
        self._measured_late = survey

    def end_as(self, ending: Ending) -> None:
        """Call all vehicles home, and end so when they are there; the caller has stored that."""
        self.ending = ending
        self.call_everybody_home()

    def set_off(self) -> None:
        """Let the flight begin: it engages every vehicle anew."""
        self.header.state = MissionState.RUNNING
        self.halted = False
        for member in self.team:
            member.disengage()
            member.refusal = ""

    def enter(self, state: MissionState, reason: str, changed_at: datetime | None = None) -> None:
        """Be in a state from now on; ``changed_at``: since when, once that is committed."""
        self.header.state, self.header.reason = state, reason
        if changed_at is not None:
            self.header.updated_at = changed_at
        self.changed.set()
        self.publish_summary()

    def recorrect(self, spec: MissionSpec, corrections: Corrections, counts: Counts) -> None:
        """Correct soundings anew, as the database has them now; the caller holds the journal's ``writing``."""
        # How long it is may have changed meanwhile.
        self.spec = spec.with_budget(self.spec.budget)
        self.gate.corrections = corrections
        self.swath.correct(corrections)
        self.recount(counts)
        self.journal.tell_of_missing_level()
        self.revision += 1

    def edit_beams(self, edits: Mapping[int, BeamEdit]) -> None:
        """Let operators have said this of beams, as the database has it; the caller holds the journal's ``writing``."""
        self.beam_edits = dict(edits)
        self.gate.corrections = self.gate.corrections.ruled(rulings_of(edits))
        self.swath.correct(self.gate.corrections)
        self.recount(self.journal.counts)
        self.revision += 1

    def state_mounting(self, vehicle: str, mounting: MountingSpec) -> None:
        """Note how the sonar of a vehicle that joins is mounted; nothing was sounded by it under another mounting."""
        if mounting == self.stated_mountings.get(vehicle, MountingSpec()):
            return
        self.stated_mountings[vehicle] = mounting
        before = self.gate.corrections
        self.gate.corrections = Corrections.of(
            self.spec, self.frame, before.table, before.adjustment, self.stated_mountings, before.rulings
        )
        self.swath.correct(self.gate.corrections)

    def relength(self, budget: Budget, left_m: Mapping[str, float]) -> None:
        """Be of another length from now on; ``left_m``: by vehicle what it may fly yet, metres, as it is stored."""
        self.spec = self.spec.with_budget(budget)
        for member in self.team:
            if member.name in left_m:
                member.flown.left_m = left_m[member.name]
            if budget.minutes is None:
                member.committed.late_m = 0.0
            elif member.legs:
                member.count_late(self.spec, self.frame)
        self.changed.set()
        self.publish_summary()

    def recount(self, counts: Counts) -> None:
        """Note that stored soundings changed, of which there are so many now."""
        self.journal.counts = counts
        self.stored_soundings.changed()
        self.feed.of_changes(self.header.step)
        self._note_late_change()

    def halt(self) -> None:
        """Keep the flight from sending anything more, and wake everyone who waits for a waypoint."""
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

    def _energy_of(self, vehicle: VehicleSpec) -> Energy:
        endurance_s = None if vehicle.endurance_min is None else 60.0 * vehicle.endurance_min
        return Energy(self.spec.speed_of(vehicle), endurance_s)

    def receive(self, event: FleetEvent) -> None:
        """Take an event from one of this mission's vehicles; called from the event loop, never blocks."""
        self.reports.take(event, self.spec, running=self._counting, standing=bool(self.standstill))
        if self._mates is not None and isinstance(event, VehicleReport):
            self._mates.note(event.vehicle)

    def withdraw(
        self,
        member: Member,
        response: Response,
        why: str,
        *,
        asked: bool = False,
        cause: WithdrawalCause = WithdrawalCause.CALLED,
    ) -> bool:
        """Take a vehicle out of the survey, unless it left that for something as strong; whether it does so now.

        The flight sends it where the response leads. ``asked``: a person wants it.
        """
        withdraws = member.withdraw(Withdrawal(response, why, asked=asked, cause=cause))
        if withdraws:
            self.changed.set()
        return withdraws

    def refuse_ending(self) -> None:
        """Raise ConflictError while everybody goes home because the mission was finished or aborted."""
        if self.ending is not None:
            raise ConflictError("everybody goes home: the mission is ending", "create a new mission")

    @property
    def awaits_batteries(self) -> bool:
        """Whether nobody surveys, and who is home with some of its way left, or goes there, is waited for."""
        return self.ending is None and self.team.awaits_batteries(self.spec)

    def call_everybody_home(self) -> None:
        """Withdraw all vehicles of a mission that is ending; those without a recovery point stop."""
        if self.ending is None:
            return
        why = f"{self.ending.state} by {self.ending.actor}"
        for member in self.team:
            home = self.spec.recovery_of(member.spec)
            self.withdraw(member, Response.STOP if home is None else Response.RETURN, why)

    async def build_map(self) -> BuiltMap | None:
        """Make the map of everything accepted so far as thoroughly as for a product, in a worker thread."""
        await self.stored_soundings.complete()
        await self.swath.complete()
        before = self.builder.newest
        built = await self.mapped(partial(self.builder.build, thorough=True))
        if built is not None and built is not before:
            self.publish_map(built)
            self.publish_summary()
        return built

    @property
    def map_is_missing(self) -> bool:
        """Whether something was measured that is in no map yet."""
        unmapped = self.builder.newest is None and self.journal.counts.pings > 0
        return self.builder.stale or self.swath.behind or (unmapped and self.swath.unread)

    async def map_what_is_stored(self) -> None:
        """Make the map of a mission that was just taken up, and tell everyone who watches how far it has come."""
        if self.map_is_missing:
            await self.build_map()
            await self.stored_soundings.keep(self.header.step, ended=self.header.state in ENDED)

    def compute_by(self, compute: Compute) -> None:
        """Have heavy work done by a cluster, where there is one."""
        self.compute = compute
        self.builder.elsewhere = compute.in_thread

    async def mapped(self, work: Callable[..., Made], *arguments: Any) -> Made:
        """Have the builder make a map in a worker thread that no vehicle waits for."""
        many = self.compute is not None and self.journal.counts.accepted >= HEAVY
        waiting = self.compute.waiting if self.compute is not None and many else None
        return await asyncio.get_running_loop().run_in_executor(waiting or self._threads.making, work, *arguments)

    async def in_thread(self, work: Callable[..., Made], *arguments: Any) -> Made:
        """Compute something that a vehicle may wait for, or that takes a moment, in a worker thread."""
        return await asyncio.get_running_loop().run_in_executor(self._threads.planning, work, *arguments)

    async def in_background(self, work: Callable[..., Made], *arguments: Any) -> Made:
        """Compute something that takes long where no vehicle waits for it."""
        return await asyncio.get_running_loop().run_in_executor(self._threads.making, work, *arguments)

    @property
    def facts(self) -> MissionFacts:
        """Return what every product states."""
        return MissionFacts(self.id, self.spec, self.frame, self.gate.corrections.vertical_datum)

    @property
    def planning_sensor(self) -> Sensor:
        """What the mission's planner takes its vehicles to measure with."""
        return SingleBeam() if self.search is None else self.search.site.scanner

    def show_reference(self, depths_m: FloatArray | None) -> None:
        """Compare the map with these depths at its cells, or with nothing."""
        self.reference_m = depths_m
        self.revision += 1

    def snapshot(self, built: BuiltMap) -> MapSnapshot:
        """Return a map with what is needed to understand it."""
        step = self.stored_soundings.step_of(built, self.header.step)
        return MapSnapshot(self.facts, built, step, self.reference_m, self.revision, interpolation=self.builder.live)

    def live_snapshot(self) -> MapSnapshot | None:
        """Return the newest map with what was sounded since; None before the first sounding. For a worker thread."""
        live = None if self.builder.live is None else self.builder.live.fresh()
        built = self.builder.newest
        if built is not None:
            return replace(self.snapshot(built), live=live)
        if live is None:
            return None
        # No map was made yet: there is nothing but what was just sounded.
        first = BuiltMap(NOT_MADE, int(live.count.sum()), map_of(self.builder.grid, live), "")
        return MapSnapshot(self.facts, first, self.header.step, self.reference_m, self.revision, live)

    def _take_soundings(self, soundings: FloatArray) -> None:
        """Take in committed soundings, shape (n, 4): east, north, depth, standard deviation."""
        self.builder.add(soundings)
        self.feed.of_soundings(len(soundings), self.header.step)
        self._note_late_change()

    def _take_pings(self, pings: Mapping[str, Pings]) -> None:
        """Take in committed pings by their vehicle."""
        self.swath.add(pings)
        self._note_late_change()
        if not self.running:
            # No flight makes maps: one is made for who asks.
            self.feed.of_soundings(sum(some.beams for some in pings.values()), self.header.step)
        for vehicle, some in pings.items():
            member, last = self.team.get(vehicle), some.take(slice(-1, None))
            try:
                reached = reach_m(self.gate.corrections.mounted(vehicle, last))
            except ValueError:
                continue  # it is nowhere near
            if member is not None and np.isfinite(reached).all():
                member.swath = Swath(float(last.time_s[0]), *reached[0].tolist())

    def publish_map(self, built: BuiltMap) -> None:
        """Tell everyone who watches that there is a new map."""
        self.feed.of_map(built, self.header.step)

    def figures(self) -> dict[str, float]:
        """Return how far the mission has come, as each step keeps it."""
        return figures(self)

    def progress(self) -> Progress:
        """Return how far the mission has come."""
        return progress(self)

    def summary(self) -> MissionSummary:
        """Return the mission as it stands in a list."""
        return summary(self)

    def publish_summary(self) -> None:
        """Tell everyone who watches about state and progress."""
        self.broadcaster.publish(StateMessage(mission=self.summary()))

    def target_views(self) -> list[TargetView]:
        """Return the moving targets, foretold for now."""
        pursuers = {member.pursuing: member.name for member in self.team if member.pursuing is not None}
        return target_views(self.ranges.tracking, self.frame, self.area, self.ranges.times.now_s(), pursuers)

    def abandon(self, why: str = "another process has the mission now") -> None:
        """Write nothing any more, and let everyone who watches ask again."""
        self.feed.stop()
        self.ranges.abandon()
        self.journal.abandon()
        self.pings.abandon()
        self.broadcaster.end(why)

    async def close(self, until_s: float | None = None) -> None:
        """Write what is left; ``until_s``: as for ``PingStore.close``."""
        await self.feed.close()
        await self.ranges.close()
        await self.journal.close()
        await self.pings.close(until_s)
        await self.stored_soundings.close(self.header.step)


def _nothing() -> None:
    return None


def builder_of(spec: MissionSpec) -> MapBuilder:
    """Return the builder of a mission's map, which knows of no sounding yet."""
    return MapBuilder(
        spec.local_area(),
        spec.cell_m,
        spec.accuracy_m,
        live=True,
        cell_of_depth=spec.coverage.cell_of_depth,
        errors=spec.uncertainty,
    )
