"""What can be done with missions: the one door through which the HTTP edge and the command line come in."""

import asyncio
import hashlib
import inspect
import math
import uuid
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from functools import cache
from pathlib import Path
from typing import Literal

import orjson
import structlog

from app.estimation import SingleBeam
from app.exploration.options import PlannerOptions
from app.exploration.planners import ONLY_IN_SIMULATION, PLANNERS, REFUSAL
from app.exploration.planners import warm_up as planning_warm_up
from app.mapping.georeference import LocalFrame
from app.mapping.gp import warm_up as mapping_warm_up
from app.mapping.products.tracks import Track, TrackPoint
from app.missions import importing, states
from app.missions.broadcast import Subscription
from app.missions.clock import now
from app.missions.correcting import check_level_is_known, corrections_view, set_sound_speed, set_tide
from app.missions.doctoring import DoctorView, Examine, doctor_view, switched_off
from app.missions.errors import (
    ConflictError,
    InvalidRequestError,
    MapNotReadyError,
    MissionNotFoundError,
    VehicleNotFoundError,
)
from app.missions.fleet import (
    BeamGeometry,
    FleetLink,
    LinkState,
    Position,
    SoundingReport,
    StopReceipt,
    VehicleReport,
    WaypointStatus,
)
from app.missions.hub import FleetHub
from app.missions.journal import event_view
from app.missions.links.rest import RestFleetLink
from app.missions.links.sim import Launch, SimFleetLink
from app.missions.live import LiveMission
from app.missions.maps import MapSnapshot
from app.missions.products import (
    MAP,
    SOUNDINGS,
    TRACKS,
    Material,
    Product,
    ProductOptions,
    make_product,
    product_kind,
)
from app.missions.runner import Runner
from app.missions.settings import ServiceSettings
from app.missions.spec import MissionSpec, SoundSpeed, VehicleKind, VehicleSpec
from app.missions.states import ENDED, MissionState
from app.missions.views import (
    ActionView,
    BatchVerdict,
    CorrectionsView,
    EventView,
    ImportOptions,
    ImportView,
    ItemVerdict,
    Level,
    LiveMessage,
    LogImportView,
    Measurement,
    MissionSummary,
    MissionView,
    PlannerView,
    ReferenceView,
    SnapshotMessage,
    StopView,
    TideCorrection,
    VehicleView,
    Verdict,
    WaypointView,
)
from app.storage import events as event_queries
from app.storage import missions as mission_queries
from app.storage import soundings as sounding_queries
from app.storage.database import Database
from app.storage.models import BatchRow, MissionRow, MissionVehicleRow, SoundingRow
from app.storage.shielding import to_the_end
from imc_bridge.soundings import Beam, StateSample, footprint

Action = Literal["start", "pause", "resume", "abort", "finish"]

MAX_BATCH = 10_000
MAX_TRACK_POINTS = 2000
ENDED_MISSIONS_IN_MEMORY = 8
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
    """

    def __init__(
        self,
        settings: ServiceSettings,
        database: Database,
        log_in: Callable[[str, str], Awaitable[str | None]] | None = None,
    ) -> None:
        self._settings = settings
        self._database = database
        self._rest = RestFleetLink()
        self._sim = SimFleetLink(settings.simulation, settings.time_scale)
        links: list[FleetLink] = [self._rest, self._sim]
        self._examine: Examine = switched_off
        self._show_area: Callable[[str, Sequence[tuple[float, float]]], None] = lambda _mission, _ring: None
        self._lead: Callable[[str, str, str | None], None] = lambda _vehicle, _guidance, _gateway: None
        if settings.imc.enabled:
            from app.missions.links.imc import make_imc_link

            imc = make_imc_link(settings.imc, settings.time_scale)
            self._examine = imc.diagnosis
            self._lead = imc.lead
            self._show_area = imc.show_area
            links.append(imc)
        if settings.neptus.enabled:
            from app.missions.neptus import NeptusSessions

            links.append(NeptusSessions(self, database, settings.neptus, log_in or _nobody).link)
        self._hub = FleetHub(links)
        self._executor = ThreadPoolExecutor(WORKERS, thread_name_prefix="planning")
        self._live: dict[str, LiveMission] = {}
        self._loading = asyncio.Lock()
        # One file after the other: reading takes memory and a core.
        self._importing = asyncio.Lock()
        self._runs: dict[str, asyncio.Task[None]] = {}
        self._acting: dict[str, asyncio.Lock] = {}
        self._started = False
        self._warm: asyncio.Future[None] | None = None

    # Life of the service

    async def startup(self) -> None:
        """Open the links and go on with every mission that was running when the process ended."""
        self._warm = asyncio.get_running_loop().run_in_executor(self._executor, _warm_up)
        await self._hub.start()
        async with self._database.reading() as session:
            rows = await mission_queries.missions_in(session, [MissionState.RUNNING, MissionState.PAUSED])
        for row in rows:
            live = await self._get(row.id)
            try:
                self._claim_team(live)
            except ConflictError as error:
                # The settings changed while the service was down: one mission's trouble is not the others'.
                await self._set_state(live, MissionState.FAILED, str(error), "service", Level.ALARM)
                continue
            if live.header.state is MissionState.RUNNING:
                self._run(live)
        self._started = True

    async def shutdown(self) -> None:
        """Stop every vehicle and write everything down; running missions stay running and go on at the next start."""
        self._started = False
        for mission_id in list(self._runs):
            await self._halt(mission_id)
        await self._hub.close()
        for live in self._live.values():
            await live.close()
        self._executor.shutdown(wait=True, cancel_futures=True)

    async def ready(self) -> tuple[bool, dict[str, str]]:
        """Tell whether requests can be served, and how each component is."""
        components = {"links": "ok" if self._started else "not started"}
        try:
            await self._database.ping()
            components["database"] = "ok"
        except Exception as error:
            components["database"] = f"cannot be reached: {error}"
        return all(state == "ok" for state in components.values()), components

    # Missions

    async def create(self, spec: MissionSpec, *, actor: str = "operator") -> MissionView:
        """Store a new mission; it is ready when it has a vehicle. Raises InvalidRequestError, ConflictError."""
        self._check_planner(spec)
        for index, vehicle in enumerate(spec.vehicles):
            self._check_vehicle(vehicle, spec, f"vehicles.{index}")
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
            session.add_all(_vehicle_row(row.id, vehicle, slot) for slot, vehicle in enumerate(spec.vehicles))
        live = await self._get(row.id)
        await live.journal.log(Level.INFO, "state", f"created by {actor}", state=row.state, actor=actor)
        return self._view(live)

    async def missions(self) -> list[MissionSummary]:
        """Return every mission, newest first."""
        async with self._database.reading() as session:
            rows = await mission_queries.all_missions(session)
        return [(await self._get(row.id)).summary() for row in rows]

    async def mission(self, mission_id: str) -> MissionView:
        """Return one mission. Raises MissionNotFoundError."""
        return self._view(await self._get(mission_id))

    async def act(self, mission_id: str, action: Action, *, actor: str, note: str = "") -> ActionView:
        """Start, pause, resume, abort or finish a mission.

        Raises
        ------
        MissionNotFoundError, MoveRefusedError, ConflictError
            The latter when a vehicle is not ready or takes part in another mission.
        """
        live = await self._get(mission_id)
        async with self._acting.setdefault(mission_id, asyncio.Lock()):
            target = states.move(live.header.state, action)
            stops: list[StopReceipt] = []
            if action in ("start", "resume"):
                self._check_team(live)
                check_level_is_known(live)
                if action == "start":
                    self._check_links(live)
                self._claim_team(live)
                await self._set_state(live, target, note, actor)
                self._run(live)
            else:
                # The state first: killed in between, a restart must not go on with an aborted mission.
                await self._set_state(live, target, note, actor)
                stops = await self._halt(mission_id)
                await self._log_stops(live, stops)
                if target in ENDED:
                    self._release_team(live)
                    await live.build_map()
                live.publish_summary()
        return ActionView(mission=live.summary(), stops=[StopView(**_receipt(stop)) for stop in stops])

    async def add_vehicle(self, mission_id: str, vehicle: VehicleSpec, *, actor: str = "operator") -> MissionView:
        """Let a vehicle join, while the mission runs too. Raises ConflictError, InvalidRequestError."""
        live = await self._get(mission_id)
        async with self._acting.setdefault(mission_id, asyncio.Lock()):
            self._refuse_ended(live, "takes no more vehicles")
            self._check_vehicle(vehicle, live.spec, "")
            if live.team.get(vehicle.name) is not None:
                raise ConflictError(
                    f"vehicle {vehicle.name!r} takes part already", "choose another name, or remove the vehicle first"
                )
            if live.header.state in (MissionState.RUNNING, MissionState.PAUSED):
                self._claim(live, vehicle)
            try:
                slot = await self._store_vehicle(mission_id, vehicle)
            except BaseException:
                self._hub.release((vehicle.kind, vehicle.name), mission_id)
                raise
            live.team.join(vehicle, slot)
            if live.header.state is MissionState.DRAFT:
                await self._set_state(live, states.move(MissionState.DRAFT, "complete_draft"), "", actor)
            await live.journal.log(Level.INFO, "vehicle", f"{vehicle.name} joined", vehicle=vehicle.name, actor=actor)
            live.changed.set()
        return self._view(live)

    async def _store_vehicle(self, mission_id: str, vehicle: VehicleSpec) -> int:
        """Write a vehicle's part in a mission down; returns its place in the depth stack."""
        async with self._database.writing() as session:
            rows = await mission_queries.vehicles_of(session, mission_id)
            known = next((row for row in rows if row.name == vehicle.name), None)
            if known is not None:
                # It comes back: it keeps its place.
                known.spec, known.left_at = vehicle.model_dump(mode="json"), None
                return known.slot
            session.add(_vehicle_row(mission_id, vehicle, len(rows)))
            return len(rows)

    async def remove_vehicle(self, mission_id: str, name: str, *, actor: str = "operator") -> MissionView:
        """Stop a vehicle and take it out of the mission. Raises VehicleNotFoundError."""
        live = await self._get(mission_id)
        async with self._acting.setdefault(mission_id, asyncio.Lock()):
            self._refuse_ended(live, "keeps its vehicles")
            member = live.team.get(name)
            if member is None:
                present = ", ".join(m.name for m in live.team) or "none"
                raise VehicleNotFoundError(
                    f"vehicle {name!r} takes no part in this mission", f"those that do: {present}"
                )
            async with self._database.writing() as session:
                for row in await mission_queries.vehicles_of(session, mission_id):
                    if row.name == name:
                        row.left_at = now()
            claimed = self._hub.claimed_by(member.key) == mission_id
            live.team.leave(name)
            live.changed.set()
            live.publish_summary()
            if claimed:
                await self._log_stops(live, [await self._hub.stop(member.key)])
                self._hub.release(member.key, mission_id)
            if live.header.state is MissionState.READY and not list(live.team):
                move = states.move(MissionState.READY, "reopen_draft")
                await self._set_state(live, move, "no vehicle left", actor)
            await live.journal.log(Level.INFO, "vehicle", f"{name} left", vehicle=name, actor=actor)
        return self._view(live)

    async def note(self, mission_id: str, level: Level, kind: str, message: str, **data: str | float) -> None:
        """Write a line of a mission's log."""
        await (await self._get(mission_id)).journal.log(level, kind, message, **data)

    # Measurements and waypoints

    async def measure(
        self, mission_id: str, items: Sequence[Measurement], *, idempotency_key: str | None = None
    ) -> BatchVerdict:
        """Take in measurements; what is counted accepted is stored for good when this returns.

        Raises
        ------
        ConflictError
            When the mission is a draft, or the idempotency key came before with other content.
        """
        live = await self._get(mission_id)
        if live.header.state is MissionState.DRAFT:
            raise ConflictError("the mission is a draft and takes no measurements yet", "add a vehicle to it first")
        if len(items) > MAX_BATCH:
            raise InvalidRequestError("items", f"{len(items)} items are too many", f"send at most {MAX_BATCH} at once")
        digest = hashlib.sha256(orjson.dumps([item.model_dump() for item in items])).hexdigest()
        strangers = {i: self._stranger(live, item) for i, item in enumerate(items)}
        reports = {i: report for i, item in enumerate(items) if not strangers[i] and (report := _sounding(item))}
        async with live.journal.writing, self._database.writing() as session:
            if idempotency_key is not None:
                known = await sounding_queries.answer_to(session, mission_id, idempotency_key)
                if known is not None:
                    if known.digest != digest:
                        raise ConflictError(
                            f"idempotency key {idempotency_key!r} was used before with other measurements",
                            "use a new key for every new batch",
                        )
                    # The first answer may have got lost together with the process that knew where the vehicle is.
                    self._hear(live, [item for i, item in enumerate(items) if not strangers[i]], only_unknown=True)
                    return BatchVerdict.model_validate(known.answer | {"replayed": True})
            verdicts, committed = await live.journal.take(list(reports.values()), session)
            answer = _batch_verdict(len(items), dict(zip(reports, verdicts, strict=True)), strangers)
            if idempotency_key is not None:
                session.add(
                    BatchRow(
                        mission_id=mission_id,
                        key=idempotency_key,
                        digest=digest,
                        answer=answer.model_dump(mode="json"),
                        created_at=now(),
                    )
                )
        committed()
        self._hear(live, [item for i, item in enumerate(items) if not strangers[i]])
        # Where the vehicle is, and whether it arrived, is on disk as well before it is answered.
        await live.journal.flush()
        return answer

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
        from app.missions.log_import import LogImport

        live = await self._get(mission_id)
        work = await asyncio.to_thread(LogImport, live, self._database, self._settings, path, vehicle)
        return await work.run(actor=actor, progress=progress)

    def _hear(self, live: LiveMission, items: Sequence[Measurement], *, only_unknown: bool = False) -> None:
        """Tell the link where vehicles are; ``only_unknown``: of those only whose place it does not know."""
        places = {name: self._hub.info((VehicleKind.REST, name)).report for name in {item.vehicle for item in items}}
        for item in items:
            if not only_unknown or places[item.vehicle] is None:
                self._rest.heard(_vehicle_report(item))

    async def waypoint(
        self, mission_id: str, vehicle: str, *, after_step: int | None = None, timeout_s: float = 0.0
    ) -> WaypointView | None:
        """Return a vehicle's waypoint when it is newer than ``after_step``, waiting for it; None when none came.

        A polling vehicle acknowledges the waypoint by this. Raises ConflictError when it must stop.
        """
        live = await self._get(mission_id)
        member = live.team.get(vehicle)
        if member is None:
            self._rest.told_to_stop(vehicle)
            raise VehicleNotFoundError(
                f"vehicle {vehicle!r} takes no part in this mission", "stop; nothing more comes from here for it"
            )
        polls = member.spec.kind is VehicleKind.REST
        after = -1 if after_step is None else after_step

        def newer() -> WaypointView | None:
            shown = live.waypoint_of(vehicle)
            ready = shown is not None and shown.step > after and shown.status is not WaypointStatus.PLANNED
            return shown if ready and member.order is not None else None

        def must_stop() -> bool:
            waits = live.header.state is MissionState.READY or (
                live.header.state is MissionState.RUNNING and not live.halted
            )
            return not waits or live.team.get(vehicle) is None

        def settled() -> bool:
            return newer() is not None or must_stop()

        if polls:
            self._rest.has_waypoint(vehicle, after)
        await _wait_watching(live, settled, timeout_s)
        if must_stop():
            if polls:
                self._rest.told_to_stop(vehicle)
            state = live.header.state if live.team.get(vehicle) is not None else "without this vehicle"
            state = "ending" if state is MissionState.RUNNING else state
            raise ConflictError(f"the mission is {state}: stop and hold", "ask again after it was started or resumed")
        found = newer()
        if found is not None and polls:
            self._rest.has_waypoint(vehicle, found.step)
            return live.waypoint_of(vehicle)
        return found

    # Corrections

    async def corrections(self, mission_id: str) -> CorrectionsView:
        """Return how a mission's soundings are corrected."""
        return corrections_view(await self._get(mission_id))

    async def set_tide(self, mission_id: str, tide: TideCorrection, *, actor: str = "operator") -> CorrectionsView:
        """Change the tide and correct every sounding anew. Raises InvalidRequestError for a table that is wrong."""
        live = await self._get(mission_id)
        async with self._acting.setdefault(mission_id, asyncio.Lock()):
            await set_tide(live, self._database, self._executor, tide, actor)
        return corrections_view(live)

    async def set_sound_speed(
        self, mission_id: str, sound_speed: SoundSpeed | None, *, actor: str = "operator"
    ) -> CorrectionsView:
        """Change the sound speed profile, or take it away, and correct every sounding anew."""
        live = await self._get(mission_id)
        async with self._acting.setdefault(mission_id, asyncio.Lock()):
            await set_sound_speed(live, self._database, self._executor, sound_speed, actor)
        return corrections_view(live)

    # From elsewhere

    async def imports(self, mission_id: str) -> list[ImportView]:
        """Return what was imported, oldest first."""
        return await importing.imports_of(await self._get(mission_id), self._database)

    async def import_soundings(
        self, mission_id: str, content: bytes, options: ImportOptions, *, actor: str = "operator"
    ) -> ImportView:
        """Begin with the soundings of a file; see ``importing.import_soundings``."""
        live = await self._get(mission_id)
        async with self._importing:
            return await importing.import_soundings(live, self._database, self._executor, content, options, actor)

    async def delete_import(self, mission_id: str, import_id: str, *, actor: str = "operator") -> None:
        """Take an import back. Raises ImportNotFoundError."""
        live = await self._get(mission_id)
        async with self._importing:
            await importing.delete_import(live, self._database, import_id, actor)

    async def reference(self, mission_id: str) -> ReferenceView:
        """Return what the map is compared with. Raises ImportNotFoundError."""
        return await importing.reference_of(await self._get(mission_id), self._database)

    async def set_reference(
        self, mission_id: str, content: bytes, options: ImportOptions, *, actor: str = "operator"
    ) -> ReferenceView:
        """Compare the map with the grid in a file from now on. Raises InvalidRequestError."""
        live = await self._get(mission_id)
        async with self._importing:
            return await importing.set_reference(live, self._database, content, options, actor)

    async def delete_reference(self, mission_id: str, *, actor: str = "operator") -> None:
        """Compare the map with nothing any more. Raises ImportNotFoundError."""
        live = await self._get(mission_id)
        async with self._importing:
            await importing.delete_reference(live, self._database, actor)

    # What came of it

    async def map(self, mission_id: str) -> MapSnapshot:
        """Return the newest map. Raises MapNotReadyError when there is no sounding yet."""
        live = await self._get(mission_id)
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

    async def tracks(self, mission_id: str) -> dict[str, list[tuple[float, float]]]:
        """Return each vehicle's track, thinned, as (longitude, latitude)."""
        await self._get(mission_id)
        async with self._database.reading() as session:
            tracks = await mission_queries.tracks(session, mission_id)
        return {name: track[:: -(-len(track) // MAX_TRACK_POINTS)] for name, track in tracks.items()}

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
            live.start_ticker()
            snapshot = await self._snapshot(live)
            yield _after(snapshot, subscription)

    def doctor(self) -> DoctorView:
        """Return what keeps IMC vehicles from working with us, as far as listening tells."""
        return doctor_view(self._examine())

    async def vehicles(self) -> list[VehicleView]:
        """Return every vehicle that is known, whether it takes part in a mission or not."""
        views = []
        for info, mission_id in self._hub.vehicles():
            member_view = None
            if mission_id is not None:
                live = await self._get(mission_id)
                member_view = next((v for v in live.vehicle_views() if v.name == info.name), None)
            report = info.report
            views.append(
                member_view
                or VehicleView(
                    name=info.name,
                    kind=VehicleKind(info.kind),
                    link=info.state,
                    reason=info.reason,
                    age_s=info.age_s,
                    address=info.address,
                    imc_id=info.imc_id,
                    lat_deg=report.position.lat_deg if report else None,
                    lon_deg=report.position.lon_deg if report else None,
                    depth_m=report.position.depth_m if report else None,
                    altitude_m=report.altitude_m if report else None,
                    speed_mps=report.speed_mps if report else None,
                    battery_pct=report.battery_pct if report else None,
                )
            )
        return views

    def planners(self) -> list[PlannerView]:
        """Return the planners that a mission may name."""
        options = PlannerOptions.model_json_schema()
        return [PlannerView(name=name, summary=_summary(kind), options=options) for name, kind in PLANNERS.items()]

    # Helpers

    async def _get(self, mission_id: str) -> LiveMission:
        live = self._live.get(mission_id)
        if live is not None:
            return live
        async with self._loading:
            if mission_id in self._live:
                return self._live[mission_id]
            async with self._database.reading() as session:
                row = await session.get(MissionRow, mission_id)
            if row is None:
                raise MissionNotFoundError(f"there is no mission {mission_id!r}", "GET /api/v1/missions lists all")
            live = await LiveMission.load(self._database, self._hub, self._executor, row)
            await self._make_room()
            self._live[mission_id] = live
            return live

    async def _make_room(self) -> None:
        idle = [m for m in self._live.values() if m.header.state in ENDED and not m.broadcaster.watched]
        for live in idle[: max(0, len(idle) - ENDED_MISSIONS_IN_MEMORY + 1)]:
            del self._live[live.id]
            await live.close()

    def _view(self, live: LiveMission) -> MissionView:
        frame = live.frame
        return MissionView(
            **live.summary().model_dump(),
            spec=live.spec,
            origin=(frame.origin_lon_deg, frame.origin_lat_deg),
            vehicles=live.vehicle_views(),
            waypoints=live.waypoints,
        )

    async def _snapshot(self, live: LiveMission) -> SnapshotMessage:
        tracks = await self.tracks(live.id)
        async with self._database.reading() as session:
            last_event_id = await event_queries.last_event_id(session, live.id)
        built = live.builder.newest
        return SnapshotMessage(
            mission=self._view(live),
            tracks=tracks,
            map_version=built.version if built else 0,
            last_event_id=last_event_id,
        )

    def _run(self, live: LiveMission) -> None:
        live.header.state = MissionState.RUNNING
        live.halted = False
        for member in live.team:
            member.engaged = False
            member.refusal = ""
        runner = Runner(live, self._database, self._hub, self._executor, self._settings.time_scale)
        self._runs[live.id] = asyncio.create_task(self._supervise(live, runner.run), name=f"mission {live.id}")

    async def _supervise(self, live: LiveMission, run: Callable[[], Awaitable[None]]) -> None:
        """Run a mission to its end; whatever happens, its vehicles are stopped."""
        try:
            if self._warm is not None:
                # Compiling what planning needs takes seconds on a new machine; vehicles must not wait for it.
                await asyncio.wait([self._warm])
            await run()
        except asyncio.CancelledError:
            raise
        except Exception as error:
            log.exception("the step loop failed", mission=live.id)
            target, level, reason = MissionState.FAILED, Level.ALARM, f"the step loop failed: {error}"
        else:
            target, level, reason = MissionState.FINISHED, Level.INFO, "every step is done"
        async with self._acting.setdefault(live.id, asyncio.Lock()):
            try:
                await to_the_end(self._conclude(live, target, reason, level))
            finally:
                self._runs.pop(live.id, None)

    async def _conclude(self, live: LiveMission, target: MissionState, reason: str, level: Level) -> None:
        """Bring a mission whose step loop ended to its end."""
        live.halt()
        stops = await self._stop_team(live)
        try:
            # What was measured until the vehicles stopped belongs to the result.
            await live.journal.flush()
            await live.build_map()
        except Exception:
            # The journal goes on trying by itself, and the map is made anew when it is asked for.
            log.exception("the last soundings are not in the map yet", mission=live.id)
        await self._set_state(live, target, reason, "service", level)
        await self._log_stops(live, stops)
        self._release_team(live)

    async def _halt(self, mission_id: str) -> list[StopReceipt]:
        """End the step loop and stop the vehicles, at once and not only when the loop has ended."""
        live = await self._get(mission_id)
        live.halt()
        task = self._runs.pop(mission_id, None)
        if task is not None:
            task.cancel()
        stops = await self._stop_team(live)
        if task is not None:
            await asyncio.gather(task, return_exceptions=True)
            # A vehicle that was just being engaged when the loop was cancelled follows now.
            again = {stop.vehicle: stop for stop in await self._stop_team(live, only_engaged=True)}
            stops = [again.get(stop.vehicle, stop) for stop in stops]
        await live.journal.flush()
        return stops

    async def _stop_team(self, live: LiveMission, *, only_engaged: bool = False) -> list[StopReceipt]:
        mine = [
            member
            for member in live.team
            if self._hub.claimed_by(member.key) == live.id
            and (not only_engaged or self._hub.info(member.key).state is LinkState.ENGAGED)
        ]
        for member in mine:
            member.engaged = False
        live.changed.set()
        return list(await asyncio.gather(*(self._hub.stop(member.key) for member in mine)))

    async def _log_stops(self, live: LiveMission, stops: Sequence[StopReceipt]) -> None:
        for stop in stops:
            level = Level.INFO if stop.acknowledged else Level.ALARM
            words = "acknowledged the stop" if stop.acknowledged else "has NOT acknowledged the stop"
            await live.journal.log(level, "stop", f"{stop.vehicle} {words}: {stop.detail}", **_receipt(stop))

    async def _set_state(
        self, live: LiveMission, state: MissionState, reason: str, actor: str, level: Level = Level.INFO
    ) -> None:
        changed_at = now()
        async with self._database.writing() as session:
            await mission_queries.set_state(session, live.id, state, reason, changed_at)
        live.header.state = state
        live.header.reason = reason
        live.header.updated_at = changed_at
        live.changed.set()
        live.publish_summary()
        words = f"{state} by {actor}" + (f": {reason}" if reason else "")
        await live.journal.log(level, "state", words, state=state, actor=actor)

    def _check_planner(self, spec: MissionSpec) -> None:
        name, use = spec.planner.name, f"use one of {', '.join(PLANNERS)}"
        if name in ONLY_IN_SIMULATION:
            raise InvalidRequestError("planner.name", REFUSAL.format(name=name), use)
        if name not in PLANNERS:
            raise InvalidRequestError("planner.name", f"there is no planner {name!r}", use)

    def _check_vehicle(self, vehicle: VehicleSpec, spec: MissionSpec, path: str) -> None:
        prefix = f"{path}." if path else ""
        if vehicle.kind not in self._hub.kinds:
            raise InvalidRequestError(
                f"{prefix}kind",
                f"links of kind {vehicle.kind} are switched off",
                f"use one of {', '.join(self._hub.kinds)} or switch them on in the settings",
            )
        if vehicle.depth_m is not None and vehicle.depth_m > spec.limits.max_depth_m:
            raise InvalidRequestError(
                f"{prefix}depth_m",
                f"{vehicle.depth_m:g} m is deeper than limits.max_depth_m, {spec.limits.max_depth_m:g} m",
                "make it shallower or raise the limit",
            )

    def _check_team(self, live: LiveMission) -> None:
        if not list(live.team):
            raise ConflictError("the mission has no vehicle", "add one: POST /api/v1/missions/{id}/vehicles")
        for member in live.team:
            owner = self._hub.claimed_by(member.key)
            if owner not in (None, live.id):
                raise ConflictError(
                    f"vehicle {member.name!r} takes part in mission {owner}",
                    "finish or abort that mission, or take the vehicle out of one of them",
                )

    def _check_links(self, live: LiveMission) -> None:
        """Refuse to start while a vehicle that is commanded over IMC is not ready. Raises ConflictError."""
        infos = [self._hub.info(member.key) for member in live.team if member.spec.kind is VehicleKind.IMC]
        missing = [info for info in infos if info.state not in (LinkState.READY, LinkState.ENGAGED)]
        if missing:
            reasons = "; ".join(f"{info.name} is {info.state}: {info.reason or 'no reason known'}" for info in missing)
            raise ConflictError(
                f"not every vehicle is ready: {reasons}",
                "wait for it, take it out of the mission, or see what 'bathyfleet doctor' finds",
            )

    def _claim_team(self, live: LiveMission) -> None:
        """Claim every vehicle, or none when one cannot be had. Raises ConflictError."""
        before = {member.key for member in live.team if self._hub.claimed_by(member.key) == live.id}
        try:
            for member in live.team:
                self._claim(live, member.spec)
        except ConflictError:
            for member in live.team:
                if member.key not in before:
                    self._hub.release(member.key, live.id)
            raise

    def _claim(self, live: LiveMission, vehicle: VehicleSpec) -> None:
        key = (vehicle.kind, vehicle.name)
        self._hub.claim(key, live.id, live.receive)
        if vehicle.kind is VehicleKind.IMC:
            self._lead(vehicle.name, vehicle.guidance, vehicle.gateway)
            self._show_area(live.spec.name, live.spec.area.ring)
        if vehicle.kind is VehicleKind.SIM:
            try:
                self._launch(live, vehicle)
            except ConflictError:
                self._hub.release(key, live.id)
                raise

    def _launch(self, live: LiveMission, vehicle: VehicleSpec) -> None:
        size = live.area.max(axis=0)
        start = (vehicle.start[1], vehicle.start[0]) if vehicle.start is not None else None
        launch = Launch(
            vehicle=vehicle.name,
            sensor=vehicle.sensor,
            south_west=(live.frame.origin_lat_deg, live.frame.origin_lon_deg),
            width_m=float(size[0]),
            height_m=float(size[1]),
            start=start,
            noise=live.spec.sounding_noise,
        )
        try:
            self._sim.launch(launch)
        except ValueError as error:
            raise ConflictError(f"vehicle {vehicle.name!r} cannot be launched: {error}", "change its start") from error

    def _release_team(self, live: LiveMission) -> None:
        self._show_area(live.spec.name, ())
        for member in live.team:
            self._hub.release(member.key, live.id)

    def _refuse_ended(self, live: LiveMission, words: str) -> None:
        if live.header.state in ENDED:
            raise ConflictError(f"the mission is {live.header.state} and {words}", "create a new mission")

    def _stranger(self, live: LiveMission, item: Measurement) -> str:
        member = live.team.get(item.vehicle)
        if member is None:
            return f"vehicle: {item.vehicle!r} takes no part in this mission"
        if member.spec.kind is not VehicleKind.REST:
            return (
                f"vehicle: {item.vehicle!r} is of kind {member.spec.kind}; only vehicles of kind rest post measurements"
            )
        return _impossible_place(item, live.frame)


async def _nobody(_password: str, _host: str) -> str | None:
    return None


@cache
def _warm_up() -> None:
    """Compile what planning needs; once in a process is enough."""
    try:
        mapping_warm_up()
        planning_warm_up(SingleBeam())
    except Exception:
        # Then the first steps compile what they need, and tell what is wrong with it.
        log.exception("compiling ahead of the first mission failed")


def _summary(kind: type[object]) -> str:
    return (inspect.getdoc(kind) or "").partition("\n\n")[0].replace("\n", " ")


def _vehicle_row(mission_id: str, vehicle: VehicleSpec, slot: int) -> MissionVehicleRow:
    return MissionVehicleRow(
        mission_id=mission_id,
        name=vehicle.name,
        slot=slot,
        spec=vehicle.model_dump(mode="json"),
        joined_at=now(),
        left_at=None,
    )


def _impossible_place(item: Measurement, frame: LocalFrame) -> str:
    if not -90 <= item.lat_deg <= 90:
        return f"lat_deg: {item.lat_deg} is not between -90 and 90"
    if not -180 <= item.lon_deg <= 180:
        return f"lon_deg: {item.lon_deg} is not between -180 and 180"
    try:
        frame.to_local(item.lat_deg, item.lon_deg)
    except ValueError as error:
        return f"lat_deg, lon_deg: {error}"
    return ""


def _sounding(item: Measurement) -> SoundingReport | None:
    if item.range_m is None:
        return None
    place, geometry = _footprint(item, item.range_m)
    return SoundingReport(
        vehicle=item.vehicle,
        time_s=item.time_s,
        footprint=place,
        vehicle_depth_m=item.depth_m,
        range_m=item.range_m,
        source="rest",
        beam=item.beam,
        depth_sd_m=item.range_sd_m,
        position_sd_m=item.position_sd_m,
        beam_geometry=geometry,
    )


def _footprint(item: Measurement, range_m: float) -> tuple[Position, BeamGeometry]:
    """Return where a beam met the bottom, and how it pointed."""
    if item.beam_off_nadir_deg is None or item.heading_deg is None:
        below = Position(item.lat_deg, item.lon_deg, item.depth_m + range_m)
        return below, BeamGeometry(item.lat_deg, item.lon_deg)
    state = StateSample(
        item.time_s,
        math.radians(item.lat_deg),
        math.radians(item.lon_deg),
        item.depth_m,
        math.radians(item.roll_deg),
        math.radians(item.pitch_deg),
        math.radians(item.heading_deg),
    )
    beam = Beam(item.beam, math.radians(item.beam_azimuth_deg), math.radians(item.beam_off_nadir_deg))
    geometry = BeamGeometry(
        item.lat_deg,
        item.lon_deg,
        item.roll_deg,
        item.pitch_deg,
        item.heading_deg,
        item.beam_azimuth_deg,
        item.beam_off_nadir_deg,
    )
    return Position(*footprint(state, beam, range_m)), geometry


def _vehicle_report(item: Measurement) -> VehicleReport:
    return VehicleReport(
        vehicle=item.vehicle,
        time_s=item.time_s,
        position=Position(item.lat_deg, item.lon_deg, item.depth_m),
        heading_rad=None if item.heading_deg is None else math.radians(item.heading_deg),
        speed_mps=item.speed_mps,
        altitude_m=item.range_m,
        battery_pct=item.battery_pct,
        position_sd_m=item.position_sd_m,
    )


def _batch_verdict(count: int, taken: Mapping[int, ItemVerdict], strangers: Mapping[int, str]) -> BatchVerdict:
    items = []
    for index in range(count):
        if index in taken:
            items.append(taken[index].model_copy(update={"index": index}))
        elif strangers[index]:
            items.append(ItemVerdict(index=index, verdict=Verdict.REJECTED, reason=strangers[index]))
        else:
            items.append(ItemVerdict(index=index, verdict=Verdict.ACCEPTED, reason="position report"))
    tally = {verdict: sum(item.verdict is verdict for item in items) for verdict in Verdict}
    return BatchVerdict(
        accepted=tally[Verdict.ACCEPTED],
        rejected=tally[Verdict.REJECTED],
        duplicate=tally[Verdict.DUPLICATE],
        items=items,
    )


def _receipt(stop: StopReceipt) -> dict[str, str | bool]:
    return {"vehicle": stop.vehicle, "acknowledged": stop.acknowledged, "detail": stop.detail}


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


async def _after(first: LiveMessage, rest: Subscription) -> AsyncIterator[LiveMessage]:
    yield first
    async for message in rest:
        yield message
