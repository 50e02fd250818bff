"""The side of a mission that lives in memory: its map, its journal, its vehicles' reports and its watchers."""

import asyncio
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from datetime import datetime
from functools import partial
from typing import Any, TypeVar

import numpy as np

from app.arrays import FloatArray
from app.compute.compute import Compute
from app.estimation import Sensor, SingleBeam
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.pings import Pings, reach_m
from app.mapping.swath.rulings import BeamRulings
from app.missions.errors import ConflictError
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import FleetEvent, VehicleReport
from app.missions.live.boundaries import Boundaries
from app.missions.live.flight_status import FlightStatus
from app.missions.live.header import Ending, MissionHeader, StoredMission
from app.missions.live.journals.journal import Counts, Journal
from app.missions.live.journals.range_journal import RangeJournal
from app.missions.live.journals.sound_speed_journal import SoundSpeedJournal
from app.missions.live.journals.swath_intake import SwathIntake
from app.missions.live.mission_map import MissionMap
from app.missions.live.placed_files import PlacedFiles
from app.missions.live.progress import figures, progress, search_progress, summary
from app.missions.live.ships import ShipsAbout
from app.missions.live.sounding_corrections import SoundingCorrections
from app.missions.live.sounding_store import SoundingStore
from app.missions.live.threads import Threads
from app.missions.live.trails import Trails
from app.missions.live.vehicle_reports import VehicleReports
from app.missions.live.watchers.broadcast import Broadcaster
from app.missions.live.watchers.feed import LiveFeed
from app.missions.live.watchers.vehicles import VehicleViews
from app.missions.live.watchers.waypoints import WaypointViews
from app.missions.maps.builder import HEAVY, MapBuilder
from app.missions.maps.snapshot import MissionFacts
from app.missions.pings.gate import PingGate
from app.missions.pings.store import PingStore
from app.missions.recovery.energy import Energy
from app.missions.search.mates import Mates
from app.missions.search.scan_log import take
from app.missions.search.state import Search
from app.missions.soundings.beam_edits import BeamEdit
from app.missions.soundings.corrections import Corrections
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
        self.corrections = SoundingCorrections(stored, self.frame, self.area, self.margin_m)
        """What its soundings are corrected by."""
        self.gate = self.corrections.gate
        """Judges and corrects what is measured."""
        self.trails = Trails(database, row.id)
        self.changed = asyncio.Event()
        """Set whenever a vehicle reported something that the flight may be waiting for."""
        self.search = search
        """What a mission of kind search knows of its site."""
        self.pings = PingStore(database, row.id, PingGate(self.frame, self.gate.outside), ping_files)
        """All its pings."""
        self.builder.swath.place = self.corrections.now.placing()
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
        self.sound_speeds = SoundSpeedJournal(database, row.id, self.journal.storage, time_scale)
        """What vehicles measure of the water."""
        self.correcting = asyncio.Lock()
        """Held while corrections change, one after the other."""
        self._fitted_budget = spec.budget
        """The length that the legs which vehicles have ahead fit into."""
        self.flight = FlightStatus()
        """How its flight stands in this process."""
        self.ending = Ending.recall(row.ending)
        """What it becomes once all vehicles are home; None while it goes on."""
        self.database = database
        """What is written through it is refused once another process has the mission."""
        self.waypoints = WaypointViews(lambda: self.spec, self.team, self.broadcaster)
        self.boundaries = Boundaries(self.area, [spec.to_local(zone) for zone in spec.keep_out])
        self.vehicles = VehicleViews(
            row.id, lambda: self.spec, self.frame, hub, self.team, self.boundaries.breach, time_scale
        )
        targets = self.target_views if spec.targets else None
        self.reports = VehicleReports(
            self.frame,
            self.team,
            self.header,
            self.journal,
            self.ranges,
            self.sound_speeds,
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
        self.map = MissionMap(
            builder,
            self.swath,
            self.stored_soundings,
            self.journal,
            self.header,
            self.feed,
            lambda: self.facts,
            self._map_executor,
            self.publish_summary,
        )
        """Its map, as it is made and shown."""
        self.placed_files = PlacedFiles()
        """Multibeams' own files that are being read."""
        self.time_scale = time_scale
        self._threads = threads
        self._parts: dict[Callable[[LiveMission], Any], Any] = {}
        self.notice_imports = Shared(self._notice_imports)
        """Count anew where logs were taken in, by the command line as well, or taken back since that was last done."""

    def part(self, kind: Callable[["LiveMission"], Part]) -> Part:
        """Return the mission's own object of a class, made of the mission when it is first asked for."""
        if kind not in self._parts:
            self._parts[kind] = kind(self)
        found: Part = self._parts[kind]
        return found

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
            self.swath.correct(self.corrections.now)
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
        return self.flight.goes_on

    @property
    def counts(self) -> Counts:
        """How much was measured in it, and is stored."""
        return self.journal.counts

    def flight_begins(self) -> None:
        """Note that its flight goes on in this process from now on."""
        self.flight.begin()
        self.call_everybody_home()

    @property
    def legs_fit_length(self) -> bool:
        """Whether the legs that vehicles have ahead fit into its length, which may have changed since they got them."""
        return self._fitted_budget == self.spec.budget

    def note_legs_fitted(self) -> None:
        """Note that legs beyond the end that it has now are being taken back."""
        self._fitted_budget = self.spec.budget

    def count_elapsed(self, seconds: float) -> None:
        """Count seconds of its flight that are stored now."""
        self.flight.store(seconds)
        self.header.elapsed_s += seconds

    def flight_ends(self) -> None:
        """Note that nobody flies it here any more."""
        self.flight.end()
        for member in self.team:
            member.come_to_rest()

    def stand_still(self, why: str) -> None:
        """Note why no vehicle may be sent anywhere; empty: at least one may again."""
        self.flight.stand_still(why)
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
        self.flight.set_off()
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
        self.corrections.apply(corrections)
        self.swath.correct(corrections)
        self.recount(counts)
        self.journal.tell_of_missing_level()
        self.map.shown_otherwise()

    def edit_beams(self, edits: Mapping[int, BeamEdit], rulings: BeamRulings) -> None:
        """Let operators have said this of beams, as the database has it; ``rulings``: what counts of it.

        The caller holds the journal's ``writing``.
        """
        self.corrections.edit_beams(edits, rulings)
        self.swath.correct(self.corrections.now)
        self.recount(self.journal.counts)
        self.map.shown_otherwise()

    def state_mounting(self, vehicle: str, mounting: MountingSpec) -> None:
        """Note how the sonar of a vehicle that joins is mounted; nothing was sounded by it under another mounting."""
        if self.corrections.state_mounting(self.spec, vehicle, mounting):
            self.swath.correct(self.corrections.now)

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
        self.flight.halt()
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
        self.reports.take(event, self.spec, running=self.flight.counting, standing=bool(self.flight.standstill))
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

    def compute_by(self, compute: Compute) -> None:
        """Have heavy work done by a cluster, where there is one."""
        self.compute = compute
        self.builder.elsewhere = compute.in_thread

    def _map_executor(self) -> Executor:
        """Return whose threads maps are made in that no vehicle waits for: large ones wait for the cluster's turn."""
        many = self.compute is not None and self.journal.counts.accepted >= HEAVY
        waiting = self.compute.waiting if self.compute is not None and many else None
        return waiting or self._threads.making

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
        self.sound_speeds.abandon()
        self.journal.abandon()
        self.pings.abandon()
        self.broadcaster.end(why)

    async def close(self, until_s: float | None = None) -> None:
        """Write what is left; ``until_s``: as for ``PingStore.close``."""
        await self.feed.close()
        await self.ranges.close()
        await self.sound_speeds.close()
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
