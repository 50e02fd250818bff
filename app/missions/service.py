"""What can be done with missions: the one door through which the HTTP edge and the command line come in."""

import asyncio
import inspect
import socket
import uuid
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import structlog

from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import PLANNERS
from app.mapping.products.tracks import Track, TrackPoint
from app.missions import states
from app.missions.clock import now
from app.missions.compilation import Compilation
from app.missions.errors import (
    ConflictError,
    InvalidRequestError,
    MapNotReadyError,
    MissionElsewhereError,
)
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import (
    FleetLink,
    StopReceipt,
)
from app.missions.fleet.links.rest import RestFleetLink
from app.missions.fleet.links.sim import SimFleetLink
from app.missions.forecast.request import Forecaster, ForecastView
from app.missions.live.journal import event_view
from app.missions.live.mission import LiveMission
from app.missions.live.trails import Trail
from app.missions.maps.products import (
    MAP,
    SOUNDINGS,
    TRACKS,
    Material,
    Product,
    ProductOptions,
    make_product,
    product_kind,
)
from app.missions.maps.snapshot import MapSnapshot
from app.missions.operations import imports
from app.missions.operations.history import map_at_step, steps_after
from app.missions.operations.imports import Imports
from app.missions.operations.measurements import measure
from app.missions.operations.polling import waypoint
from app.missions.operations.reading import Reader
from app.missions.operations.recorrection import check_level_is_known, corrections_view, set_sound_speed, set_tide
from app.missions.operations.review import rule, soundings_page
from app.missions.operations.scans import scan, search_of
from app.missions.operations.target_pages import target_ranges_page
from app.missions.operations.uploads import Upload, Uploads
from app.missions.preflight.survey import preflight
from app.missions.running.admission import check_spec
from app.missions.running.claims import Claims, free_elsewhere
from app.missions.running.deletion import check_deletable, delete_mission
from app.missions.running.failover import Failover
from app.missions.running.final_maps import FinalMaps
from app.missions.running.mission_views import (
    action_view,
    beginning_with,
    idle_vehicle_view,
    mission_view,
    snapshot_message,
)
from app.missions.running.ownership import Ownership
from app.missions.running.registry import MissionRegistry
from app.missions.running.supervisor import MissionSupervisor
from app.missions.running.team_changes import TeamChanges, refuse_ended, vehicle_row
from app.missions.search.obstacles import obstacles_geojson
from app.missions.search.progress import grid_view
from app.missions.search.scan_schema import Scan
from app.missions.settings import ServiceSettings
from app.missions.soundings.measurement import Measurement
from app.missions.spec.mission import MissionKind, MissionSpec, SoundSpeed, VehicleSpec
from app.missions.states import ENDED, Action, MissionState
from app.missions.views.corrections import CorrectionsView, TideCorrection
from app.missions.views.doctor import DoctorView, Examine, doctor_view, switched_off
from app.missions.views.imports import ImportOptions, ImportView, ReferenceView
from app.missions.views.messages import LiveMessage
from app.missions.views.mission import (
    ActionView,
    EventView,
    Level,
    MissionSummary,
    MissionView,
    PlannerView,
    PreflightView,
    StepView,
    VehicleView,
    WaypointView,
)
from app.missions.views.search import SearchGridView
from app.missions.views.soundings import BatchVerdict, LogImportView, Ruling, SoundingPage, SoundingState, SoundingView
from app.missions.views.targets import TargetRangePage, TargetView
from app.missions.views.telemetry import TelemetryView, telemetry_view
from app.storage import events as event_queries
from app.storage import missions as mission_queries
from app.storage import soundings as sounding_queries
from app.storage import telemetry as telemetry_queries
from app.storage.database import Database
from app.storage.fast_read import AtOnce
from app.storage.models import MissionRow, SoundingRow

NO_FORECAST = "what a search will find cannot be forecast: it depends on what stands there"
WORKERS = 2

log = structlog.get_logger(__name__)


class MissionService:
    """All missions of this process.

    Parameters
    ----------
    settings
        See :class:`ServiceSettings`.
    database
        Migrated and open; the caller closes it after ``shutdown``.
    log_in
        Who may use the Neptus gateway with a password from a host; without it nobody.
    is_own_user
        Whether a connection that the gateway accepts is of the user who runs this process.
    url, certificate
        Where other processes on the same database reach this one, and the certificate (PEM) that it shows them.
    """

    def __init__(
        self,
        settings: ServiceSettings,
        database: Database,
        log_in: Callable[[str, str, bool], Awaitable[str | None]] | None = None,
        *,
        is_own_user: Callable[[socket.socket], bool] = lambda _connection: False,
        url: str = "",
        certificate: str | None = None,
    ) -> None:
        self._settings = settings
        self._database = database
        self._at_once = AtOnce(database)
        links: list[FleetLink] = [RestFleetLink(), SimFleetLink(settings.simulation, settings.time_scale)]
        self._examine: Examine = switched_off
        if settings.imc.enabled:
            from app.missions.fleet.links.imc import make_imc_link

            imc = make_imc_link(settings.imc, settings.time_scale)
            self._examine = imc.diagnosis
            links.append(imc)
        if settings.neptus.enabled:
            from app.missions.neptus_sessions import NeptusSessions

            links.append(NeptusSessions(self, database, settings.neptus, log_in or _nobody, is_own_user).link)
        self._hub = FleetHub(links)
        self._executor = ThreadPoolExecutor(WORKERS, thread_name_prefix="planning")
        self._claims = Claims(self._hub)
        self._maps = FinalMaps()
        self._forecaster = Forecaster(self._hub.capabilities)
        self._compilation = Compilation(self._executor)
        self._supervisor = MissionSupervisor(
            self._hub, self._claims, self._executor, self._maps, self._compilation, settings.time_scale
        )
        self._runs = self._supervisor.runs
        self._team_changes = TeamChanges(self._hub, self._claims, self._supervisor)
        self._registry = MissionRegistry(database, self._hub, self._executor, self._maps, settings.time_scale)
        self.process = Ownership(database, url, certificate)
        """This process among those that share the database."""
        self._failover = Failover(database, self._hub, self.process, self._registry, self._supervisor, self._claims)
        self.uploads = Uploads()
        """Files on their way in."""
        self._imports = Imports(Reader(unconfined=settings.unconfined_imports), self._executor)
        self._started = False

    # Life of the service

    async def startup(self) -> None:
        """Open the links, join the processes that share the database and go on with missions that nobody has."""
        self._compilation.begin()
        await self._hub.start()
        self._registry.share(self.process, self._failover.may_take_up, self._failover.resume)
        await self._failover.begin()
        self._started = True

    async def shutdown(self) -> None:
        """Stop every vehicle and write everything down.

        Running missions stay running: another process takes them up, or this one at its next start.
        """
        self._started = False
        await self._failover.end()
        await asyncio.gather(*(self._supervisor.halt(live) for live in self._registry if live.id in self._runs))
        await self._maps.close()
        await self._hub.close()
        await self._supervisor.close()
        await self._registry.close()
        await self.process.leave()
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._forecaster.close()
        self._at_once.close()

    async def ready(self) -> tuple[bool, dict[str, str]]:
        """Tell whether requests can be served, and how each component is."""
        components = {"links": "ok" if self._started else "not started"}
        try:
            await self._database.ping()
            components["database"] = self._database.trouble or "ok"
        except Exception as error:
            components["database"] = f"cannot be reached: {error}"
        return all(state == "ok" for state in components.values()), components

    # Missions

    async def create(self, spec: MissionSpec, *, actor: str = "operator") -> MissionView:
        """Store a new mission; it is ready when it has a vehicle. Raises InvalidRequestError, ConflictError."""
        check_spec(spec, self._hub.kinds)
        created = now()
        row = MissionRow(
            id=str(uuid.uuid4()),
            name=spec.name,
            state=MissionState.READY if spec.vehicles else MissionState.DRAFT,
            reason="" if spec.vehicles else "no vehicle yet",
            spec=spec.model_dump(mode="json"),
            created_at=created,
            updated_at=created,
            elapsed_s=0.0,
        )
        async with self._database.writing() as session:
            session.add(row)
            await session.flush()
            session.add_all(vehicle_row(row.id, vehicle, slot) for slot, vehicle in enumerate(spec.vehicles))
        live = await self._get(row.id)
        await live.journal.log(Level.INFO, "state", f"created by {actor}", state=row.state, actor=actor)
        return mission_view(live)

    async def missions(self) -> list[MissionSummary]:
        """Return every mission that no other process has, newest first."""
        # One that ended and left memory is as it was then: taking it up again for every list would be slow.
        found = [
            self._registry.left(one) or await self._summary(one) for (one,) in await self._at_once(mission_queries.ALL)
        ]
        return [summary for summary in found if summary is not None]

    async def _summary(self, mission_id: str) -> MissionSummary | None:
        try:
            return (await self._get(mission_id)).summary()
        except MissionElsewhereError:
            return None

    async def check_exists(self, mission_id: str) -> None:
        """Raise MissionNotFoundError where there is no such mission; costs little, whoever has it."""
        await self._registry.check_exists(mission_id)

    async def mission(self, mission_id: str) -> MissionView:
        """Return one mission. Raises MissionNotFoundError."""
        return mission_view(await self._get(mission_id))

    async def act(self, mission_id: str, action: Action, *, actor: str, note: str = "") -> ActionView:
        """Start, pause, resume, abort or finish a mission.

        Raises
        ------
        MissionNotFoundError, MoveRefusedError, ConflictError
            The latter when a vehicle is not ready or takes part in another mission.
        """
        live = await self._get(mission_id)
        async with self._supervisor.acting(mission_id):
            target = states.move(live.header.state, action)
            stops: list[StopReceipt] = []
            if action in ("start", "resume"):
                self._claims.check_team(live)
                check_level_is_known(live)
                if action == "start":
                    self._claims.check_links(live)
                self._claims.claim_team(live)
                try:
                    await self._supervisor.set_state(live, target, note, actor, check=free_elsewhere(live))
                except BaseException:
                    if action == "start":
                        self._claims.release_team(live)
                    raise
                self._supervisor.run(live)
            else:
                stops = await self._supervisor.stand_down(live, target, note, actor)
                if target in ENDED:
                    self._supervisor.dismiss(live)
                live.publish_summary()
        return action_view(live, stops)

    async def delete(self, mission_id: str) -> None:
        """Remove a mission in which nothing was measured. Raises MissionNotFoundError, ConflictError."""
        live = await self._get(mission_id)
        async with self._supervisor.acting(mission_id):
            check_deletable(live)
            self._maps.forget(mission_id)
            await delete_mission(live)
            await self._registry.forget(mission_id)

    async def add_vehicle(self, mission_id: str, vehicle: VehicleSpec, *, actor: str = "operator") -> MissionView:
        """Let a vehicle join, while the mission runs too. Raises ConflictError, InvalidRequestError."""
        live = await self._get(mission_id)
        await self._team_changes.join(live, vehicle, actor)
        return mission_view(live)

    async def rejoin_vehicle(self, mission_id: str, name: str, *, actor: str = "operator") -> MissionView:
        """Let a vehicle that left take part again. Raises VehicleNotFoundError, ConflictError."""
        live = await self._get(mission_id)
        await self._team_changes.rejoin(live, name, actor)
        return mission_view(live)

    async def remove_vehicle(self, mission_id: str, name: str, *, actor: str = "operator") -> MissionView:
        """Stop a vehicle and take it out of the mission. Raises VehicleNotFoundError, ConflictError."""
        live = await self._get(mission_id)
        refuse_ended(live, "keeps its vehicles")
        await self._team_changes.stop_one(live, name, actor)
        return mission_view(live)

    async def abort_vehicle(self, mission_id: str, name: str, *, actor: str = "operator") -> ActionView:
        """Stop a vehicle and take it out of the mission; returns whether it acknowledged that.

        When the mission has ended the vehicle stays in it and is told once more.
        """
        live = await self._get(mission_id)
        return action_view(live, await self._team_changes.stop_one(live, name, actor))

    async def preflight(self, mission_id: str) -> PreflightView:
        """Return what stands before a mission's start."""
        return preflight(await self._get(mission_id), self._hub)

    async def forecast(self, spec: MissionSpec, *, floor_depth_m: float | None = None) -> ForecastView:
        """Return what is to be expected of a mission as it is described. Raises InvalidRequestError."""
        check_spec(spec, self._hub.kinds)
        if spec.kind is MissionKind.SEARCH:
            raise InvalidRequestError("kind", NO_FORECAST, "forecast missions of kind survey")
        # The time that a forecast may take is for steps, not for compiling.
        await self._compilation.maps()
        return await self._forecaster.make(spec, floor_depth_m=floor_depth_m)

    async def forecast_of(self, mission_id: str, *, floor_depth_m: float | None = None) -> ForecastView:
        """Return what is to be expected of a stored mission from now on. Raises ConflictError, InvalidRequestError."""
        live = await self._get(mission_id)
        refuse_ended(live, "has nothing before it")
        if live.search is not None:
            raise ConflictError(NO_FORECAST, "see its time window, search.window_s")
        async with self._database.reading() as session:
            prior = await sounding_queries.imported_arrays(session, mission_id)
        await self._compilation.maps()
        team = [replace(member, report=member.report or self._hub.info(member.key).report) for member in live.team]
        return await self._forecaster.make(
            live.spec,
            members=team,
            prior=prior,
            first_step=live.header.step + 1,
            floor_depth_m=floor_depth_m,
        )

    async def write_note(self, mission_id: str, text: str, *, actor: str) -> EventView:
        """Keep an operator's words in a mission's log."""
        live = await self._get(mission_id)
        row = live.journal.line(Level.INFO, "note", text, actor=actor)
        await live.journal.write(row)
        return event_view(row)

    async def note(self, mission_id: str, level: Level, kind: str, message: str, **data: str | float) -> None:
        """Write a line of a mission's log."""
        await (await self._get(mission_id)).journal.log(level, kind, message, **data)

    # Measurements and waypoints

    async def measure(
        self,
        mission_id: str,
        items: Sequence[Measurement],
        *,
        idempotency_key: str | None = None,
        sender: str = "",
    ) -> BatchVerdict:
        """Take in measurements; see ``measuring.measure``."""
        live = await self._get(mission_id)
        return await measure(live, self._hub, items, idempotency_key=idempotency_key, sender=sender)

    async def waypoint(
        self, mission_id: str, vehicle: str, *, after_step: int | None = None, timeout_s: float = 0.0
    ) -> WaypointView | None:
        """Return a vehicle's waypoint when it is newer than ``after_step``; see ``polling.waypoint``."""
        return await waypoint(
            await self._get(mission_id), self._hub, vehicle, after_step=after_step, timeout_s=timeout_s
        )

    async def import_log(
        self,
        mission_id: str,
        path: Path,
        *,
        vehicle: str | None = None,
        actor: str,
        progress: Callable[[int, int], None] | None = None,
    ) -> LogImportView:
        """Take in a vehicle's own log; importing it again, also after a crash, stores nothing twice.

        Raises
        ------
        InvalidRequestError
            When the file is no log of a vehicle, or does not tell which one's.
        """
        from app.missions.operations.log_import import LogImport

        live = await self._get(mission_id)
        work = await asyncio.to_thread(LogImport, live, self._settings, path, vehicle)
        return await work.run(actor=actor, progress=progress)

    # Soundings that are not in the map

    async def review(
        self,
        mission_id: str,
        states: Sequence[SoundingState],
        *,
        vehicle: str | None = None,
        after: int = 0,
        limit: int = 200,
    ) -> SoundingPage:
        """Return soundings in any of the states, a page of them."""
        return await soundings_page(await self._get(mission_id), states, vehicle, after, limit)

    async def rule(
        self, mission_id: str, sounding_id: int, ruling: Ruling, *, note: str = "", actor: str = "operator"
    ) -> SoundingView:
        """Restore a sounding or reject it; see ``reviewing.rule``."""
        return await rule(await self._get(mission_id), sounding_id, ruling, note, actor)

    # Moving targets

    async def targets(self, mission_id: str) -> list[TargetView]:
        """Return what is known of a mission's moving targets now."""
        return (await self._get(mission_id)).target_views()

    async def target_ranges(
        self, mission_id: str, *, target: str | None = None, after: int = 0, limit: int = 200
    ) -> TargetRangePage:
        """Return ranges to targets, a page of them."""
        return await target_ranges_page(await self._get(mission_id), target, after, limit)

    # Searches

    async def scan(self, mission_id: str, items: Sequence[Scan]) -> BatchVerdict:
        """Take in scans; see ``scanning.scan``."""
        return await scan(await self._get(mission_id), items)

    async def search_grid(self, mission_id: str, *, after: int | None = None) -> SearchGridView | None:
        """Return a search's site as known now; None when nothing is newer than ``after``. Raises ConflictError."""
        live = await self._get(mission_id)
        search = search_of(live)
        return None if after is not None and search.version <= after else grid_view(search, live.id, live.frame)

    async def search_obstacles(self, mission_id: str) -> bytes:
        """Return the obstacles of a search's site as GeoJSON. Raises ConflictError."""
        live = await self._get(mission_id)
        return await live.in_thread(obstacles_geojson, search_of(live), live.frame)

    # Corrections

    async def corrections(self, mission_id: str) -> CorrectionsView:
        """Return how a mission's soundings are corrected."""
        return corrections_view(await self._get(mission_id))

    async def set_tide(self, mission_id: str, tide: TideCorrection, *, actor: str = "operator") -> CorrectionsView:
        """Change the tide and correct every sounding anew. Raises InvalidRequestError for a table that is wrong."""
        live = await self._get(mission_id)
        async with live.correcting:
            await set_tide(live, self._executor, tide, actor)
        return corrections_view(live)

    async def set_sound_speed(
        self, mission_id: str, sound_speed: SoundSpeed | None, *, actor: str = "operator"
    ) -> CorrectionsView:
        """Change the sound speed profile, or take it away, and correct every sounding anew."""
        live = await self._get(mission_id)
        async with live.correcting:
            await set_sound_speed(live, self._executor, sound_speed, actor)
        return corrections_view(live)

    # From elsewhere

    async def imports(self, mission_id: str) -> list[ImportView]:
        """Return what was imported, oldest first."""
        return await imports.imports_of(await self._get(mission_id))

    async def expect_file(self, mission_id: str, options: ImportOptions) -> None:
        """Say before a file comes what would be wrong with it. Raises MissionNotFoundError, InvalidRequestError."""
        await self._get(mission_id)
        imports.kind_of(options)

    async def import_soundings(
        self, mission_id: str, upload: Upload, options: ImportOptions, *, actor: str = "operator"
    ) -> ImportView:
        """Begin with the soundings of a file; see ``imports.Imports.add``."""
        live = await self._get(mission_id)
        view = await self._imports.add(live, upload, options, actor)
        self._map_imports(live)
        return view

    async def delete_import(self, mission_id: str, import_id: str, *, actor: str = "operator") -> None:
        """Take an import back. Raises ImportNotFoundError."""
        live = await self._get(mission_id)
        await self._imports.delete(live, import_id, actor)
        self._map_imports(live)

    def _map_imports(self, live: LiveMission) -> None:
        """Show what was imported at once; while the mission runs its next step does."""
        if live.id not in self._runs:
            self._maps.take_up(live)

    async def reference(self, mission_id: str) -> ReferenceView:
        """Return what the map is compared with. Raises ImportNotFoundError."""
        return await imports.reference_of(await self._get(mission_id))

    async def set_reference(
        self, mission_id: str, upload: Upload, options: ImportOptions, *, actor: str = "operator"
    ) -> ReferenceView:
        """Compare the map with the grid in a file from now on; see ``imports.Imports.set_reference``."""
        return await self._imports.set_reference(await self._get(mission_id), upload, options, actor)

    async def delete_reference(self, mission_id: str, *, actor: str = "operator") -> None:
        """Compare the map with nothing any more. Raises ImportNotFoundError."""
        await self._imports.delete_reference(await self._get(mission_id), actor)

    # What came of it

    async def steps(self, mission_id: str, *, after: int = 0, limit: int = 1000) -> list[StepView]:
        """Return up to ``limit`` steps with a number above ``after``."""
        return await steps_after(await self._get(mission_id), after, limit)

    async def telemetry(self, mission_id: str, points: int) -> TelemetryView:
        """Return what the vehicles told of themselves, at about ``points`` moments at most."""
        live = await self._get(mission_id)
        await live.journal.flush()
        async with self._database.reading() as session:
            rows = await telemetry_queries.samples(session, mission_id, points)
        return telemetry_view(rows)

    async def map_tiles(
        self, mission_id: str, run: str, since: str, further: Sequence[str] = (), step: int | None = None
    ) -> bytes:
        """Return what changed in the map; see ``TileCache.changes``. ``step``: the map as it was at that step's end.

        ``run`` tells this process from others, whose versions begin at 1, too.
        """
        live = await self._get(mission_id)
        snapshot = None
        if step is not None:
            snapshot = await map_at_step(live, step)
        elif mission_id in self._runs:
            # Not with the planning threads, which a decision may keep for seconds.
            snapshot = await asyncio.to_thread(live.live_snapshot)
        if snapshot is None:
            snapshot = await self.map(mission_id, patient=False)
        tag = f"{run}.{snapshot.tag}" + ("" if step is None else f"@{step}")
        return await live.tiles.answer(snapshot, tag, since, tuple(sorted(set(further))))

    async def map(self, mission_id: str, *, patient: bool = True) -> MapSnapshot:
        """Return the newest map. Raises MapNotReadyError when there is no sounding yet.

        Without being ``patient``: an older one, if there is one, while a newer one is being made.
        """
        live = await self._get(mission_id)
        built = live.builder.newest
        if not patient and built is not None and self._maps.busy(mission_id):
            return live.snapshot(built)
        await self._maps.last(mission_id)
        await live.notice_imports()
        built = live.builder.newest
        if built is None or (live.builder.stale and mission_id not in self._runs):
            built = await live.build_map()
        if built is None:
            raise MapNotReadyError(
                "no sounding was accepted yet, so there is no map", "start the mission or post measurements"
            )
        return live.snapshot(built)

    async def export(self, mission_id: str, name: str, options: ProductOptions | None = None) -> Product:
        """Return a product file of the mission, a key of ``PRODUCTS``.

        Raises
        ------
        InvalidRequestError, MapNotReadyError
            For an unknown kind or options that cannot be; where the map is needed and there is none yet.
        """
        needs = product_kind(name).needs
        material = Material(
            facts=(await self._get(mission_id)).facts,
            created=now(),
            provider=self._settings.provider.named(),
            map=await self.map(mission_id) if MAP in needs else None,
            soundings=await self.soundings(mission_id) if SOUNDINGS in needs else (),
            tracks=await self._track_lines(mission_id) if TRACKS in needs else (),
        )
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._executor, make_product, name, material, options or ProductOptions())

    async def _track_lines(self, mission_id: str) -> list[Track]:
        live = await self._get(mission_id)
        await live.journal.flush()
        async with self._database.reading() as session:
            found = await mission_queries.track_points(session, mission_id)
        return [Track(name, [TrackPoint(*point) for point in points]) for name, points in found.items()]

    async def soundings(self, mission_id: str) -> Sequence[SoundingRow]:
        """Return every sounding, rejected ones included, in the order they came."""
        live = await self._get(mission_id)
        await live.journal.flush()
        async with self._database.reading() as session:
            return await sounding_queries.all_soundings(session, mission_id)

    async def tracks(self, mission_id: str) -> dict[str, Trail]:
        """Return each vehicle's track as (longitude, latitude, depth), without the places that nobody would miss."""
        return await (await self._get(mission_id)).trails.newest()

    async def events(self, mission_id: str, *, after: int = 0, limit: int = 1000) -> list[EventView]:
        """Return up to ``limit`` lines of the log with an id above ``after``, oldest first."""
        await self._get(mission_id)
        async with self._database.reading() as session:
            rows = await event_queries.events_after(session, mission_id, after, limit)
        return [event_view(row) for row in rows]

    @asynccontextmanager
    async def subscribe(self, mission_id: str) -> AsyncIterator[AsyncIterator[LiveMessage]]:
        """Yield live messages, the first of them a snapshot. A watcher that is too slow loses only positions."""
        live = await self._get(mission_id)
        with live.broadcaster.subscribe() as subscription:
            live.telling.start()
            yield beginning_with(await snapshot_message(live), subscription)

    def doctor(self) -> DoctorView:
        """Return what keeps IMC vehicles from working with us, as far as listening tells."""
        return doctor_view(self._examine())

    async def vehicles(self) -> list[VehicleView]:
        """Return every vehicle that is known, whether it takes part in a mission or not."""
        views = []
        for info, mission_id in self._hub.vehicles():
            member = None if mission_id is None else (await self._get(mission_id)).vehicles.of(info)
            views.append(member or idle_vehicle_view(info))
        return views

    def planners(self) -> list[PlannerView]:
        """Return the planners that a mission may name."""
        options = PlannerOptions.model_json_schema()
        return [PlannerView(name=name, summary=_summary(kind), options=options) for name, kind in PLANNERS.items()]

    # Helpers

    async def _get(self, mission_id: str) -> LiveMission:
        return await self._registry.get(mission_id)


async def _nobody(_password: str, _host: str, _own_user: bool) -> str | None:
    return None


def _summary(kind: type[object]) -> str:
    return (inspect.getdoc(kind) or "").partition("\n\n")[0].replace("\n", " ")
