"""The life of missions: the service that opens and closes, and missions that are created, move and end.

What else is done with a mission, the functions of ``operations``, ``preflight`` and ``forecast`` do with what ``get``
returns.
"""

import asyncio
import socket
import uuid
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import structlog
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.ext.asyncio import AsyncSession

from app.compute.compute import Compute
from app.exploration.planners import INSTALLED
from app.missions import states
from app.missions.alarms.dispatcher import AlarmDispatcher
from app.missions.clock import now
from app.missions.compilation import Compilation
from app.missions.errors import InvalidRequestError, MissionElsewhereError, MissionNotFoundError, MissionUnreadableError
from app.missions.fleet.hub import FleetHub
from app.missions.fleet.interface import FleetLink, StopReceipt
from app.missions.fleet.links.rest import RestFleetLink
from app.missions.fleet.links.sim import SimFleetLink
from app.missions.forecast.preview import PlanPreviews
from app.missions.forecast.request import Forecaster
from app.missions.live.header import Ending
from app.missions.live.mission import LiveMission
from app.missions.live.threads import make_threads
from app.missions.operations.corrections.recorrection import check_level_is_known
from app.missions.operations.imports.imports import Imports
from app.missions.operations.imports.log_uploads import LogUploads
from app.missions.operations.imports.reader_process import Reader
from app.missions.operations.imports.uploads import Uploads
from app.missions.operations.maps.map_pictures import MapPictures
from app.missions.operations.reports import Reports
from app.missions.operations.sites.site_models import SiteModels
from app.missions.operations.sites.sites import Sites
from app.missions.operations.traffic import places_of, traffic_view
from app.missions.operations.work_processes import WorkProcesses
from app.missions.preflight.neighbours import neighbour_checks
from app.missions.running.admission import check_spec
from app.missions.running.claims import Claims, free_elsewhere
from app.missions.running.descriptions import describe_anew
from app.missions.running.failover import Failover
from app.missions.running.final_maps import FinalMaps
from app.missions.running.homecoming import returns, send_on
from app.missions.running.lengths import set_budget
from app.missions.running.mission_views import action_view, idle_vehicle_view, mission_view
from app.missions.running.ownership import Ownership
from app.missions.running.registry import MissionRegistry
from app.missions.running.supervisor import MissionSupervisor
from app.missions.running.team_changes import TeamChanges, vehicle_row
from app.missions.settings import ServiceSettings
from app.missions.spec.budget import Budget
from app.missions.spec.mission import MissionSpec
from app.missions.states import AT_SEA, ENDED, Action, MissionState
from app.missions.succession import Succession
from app.missions.task.survey_lines import line_remarks
from app.missions.traffic.watch import Traffic
from app.missions.views.doctor import DoctorView, Examine, doctor_view, switched_off
from app.missions.views.mission import ActionView, Level, MissionSummary, MissionView, VehicleView
from app.missions.views.traffic import TrafficView, traffic_findings
from app.storage.database import Database, Guard
from app.storage.fast_read import AtOnce
from app.storage.models import MissionRow
from app.storage.ping_files import PingFiles
from app.storage.queries import missions as mission_queries
from app.storage.queries.sites import set_site
from app.storage.upkeep.retention import finish_removing

log = structlog.get_logger(__name__)

COMPILERS = 2


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
        self.settings = settings
        self._database = database
        self._at_once = AtOnce(database)
        self._examine: Examine = switched_off
        self.hub = FleetHub(self._links(log_in or _nobody, is_own_user))
        """All links."""
        self._processes = WorkProcesses()
        self.compute = Compute(settings.compute, self._processes)
        """Does what computes long."""
        self._threads = make_threads()
        self._claims = Claims(self.hub)
        self.maps = FinalMaps()
        """Maps that are made while nobody waits for them."""
        self.map_pictures = MapPictures()
        """Pictures of maps for web maps and GIS."""
        self._compiling = ThreadPoolExecutor(COMPILERS, thread_name_prefix="compiling")
        self._compilation = Compilation(self._compiling)
        self.forecaster = Forecaster(self.hub, self._compilation, self.compute)
        """Flies missions ahead."""
        self.previews = PlanPreviews(self.hub, self._compilation)
        """Plans of missions that are being described."""
        self._supervisor = MissionSupervisor(
            self.hub, self._claims, self._threads.planning, self.maps, self._compilation, settings
        )
        self._runs = self._supervisor.runs
        self.team_changes = TeamChanges(self.hub, self._claims, self._supervisor)
        """Vehicles that join missions and leave them."""
        self._ping_files = PingFiles.beside(settings.database_url, settings.pings_url)
        self.traffic = Traffic(settings.ais, lambda: places_of(self._registry))
        """Ships about."""
        self._registry = MissionRegistry(
            database,
            self.hub,
            self._threads,
            self.maps,
            self._ping_files,
            settings.time_scale,
            self.traffic,
            self.compute,
        )
        self.process = Ownership(database, url, certificate)
        """This process among those that share the database."""
        self.alarms = AlarmDispatcher(settings.alarms, database, lambda: self.process.number)
        """Alarms of all missions: who is told, and who has taken them."""
        self._failover = Failover(database, self.hub, self.process, self._registry, self._supervisor, self._claims)
        self.uploads = Uploads()
        """Files on their way in."""
        self.imports = Imports(Reader(unconfined=settings.unconfined_imports), self.maps)
        """Files that missions begin with or are compared with."""
        self.logs = LogUploads(settings, self.get, self._registry.hold, self.maps)
        """Vehicles' own logs that are sent."""
        self.reports = Reports(self.maps, settings.provider, self.compute)
        """Reports of surveys."""
        self.site_models = SiteModels(database, self.get, self.maps, lambda: self._started)
        """What is known of places that are surveyed again and again."""
        self.sites = Sites(database, self.site_models, self.maps, self.imports)
        """Places that are surveyed again and again."""
        self._succession = Succession(database, self.get, self._start_following)
        self._supervisor.ended = self._succession.ended
        self._removing: asyncio.Task[None] | None = None
        self._started = self._written = False
        self.vehicles_stopped = asyncio.Event()
        """Set when the service ends and has stopped the vehicles: until then they may poll, and are told so."""

    def _links(
        self, log_in: Callable[[str, str, bool], Awaitable[str | None]], is_own_user: Callable[[socket.socket], bool]
    ) -> list[FleetLink]:
        """Return the links that are switched on."""
        settings = self.settings
        links: list[FleetLink] = [
            RestFleetLink(settings.time_scale),
            SimFleetLink(settings.simulation, settings.time_scale),
        ]
        if settings.imc.enabled:
            from app.missions.fleet.links.imc import make_imc_link

            imc = make_imc_link(settings.imc, settings.time_scale)
            self._examine = imc.diagnosis
            links.append(imc)
        if settings.neptus.enabled:
            from app.missions.neptus_sessions import NeptusSessions

            links.append(NeptusSessions(self, self._database, settings.neptus, log_in, is_own_user).link)
        return links

    # Life of the service

    async def startup(self) -> None:
        """Open the links, join the processes that share the database and go on with missions that nobody has."""
        for planner in INSTALLED.broken.values():
            log.warning("planner cannot be used", planner=planner.name, package=planner.package, reason=planner.reason)
        self._compilation.begin()
        self.compute.start()
        await self.hub.start()
        await self.traffic.start()
        self._registry.share(self.process, self._failover.may_take_up, self._taken_up)
        await self._failover.begin()
        self.alarms.start()
        await self._succession.begin()
        self._removing = asyncio.create_task(self._finish_removing(), name="remove files of pings")
        self._started = True

    async def _finish_removing(self) -> None:
        """Remove what is left of missions that were removed; where their files are may not answer."""
        try:
            await finish_removing(self._database, self._ping_files)
        except Exception as error:
            log.warning("files of pings of removed missions stay: they could not be looked for", error=str(error))

    def begin_no_more(self) -> None:
        """Begin no flight from now on, whoever asks: the vehicles are about to be stopped."""
        self._started = False
        self._supervisor.begin_no_more()

    async def stop_vehicles(self) -> None:
        """Stop every vehicle, before anything else is waited for, and begin no flight any more."""
        self.begin_no_more()
        self._failover.cancel()
        flying = [live for live in self._registry if live.id in self._runs]
        halted = await asyncio.gather(*map(self._supervisor.halt, flying), return_exceptions=True)
        for live, stops in zip(flying, halted, strict=True):
            if isinstance(stops, BaseException):
                log.error("a mission's vehicles could not be stopped", mission=live.id, exc_info=stops)
                continue
            for stop in stops:
                tell = log.info if stop.acknowledged else log.error
                words = "acknowledged the stop" if stop.acknowledged else "has NOT acknowledged the stop"
                tell(f"the service ends: {stop.vehicle} {words}", mission=live.id, detail=stop.detail)
        self.vehicles_stopped.set()

    @property
    def all_written(self) -> bool:
        """Whether the service ends, has stopped all vehicles, and has written down everything that was accepted."""
        return self._written

    async def shutdown(self) -> None:
        """Stop every vehicle and write everything down.

        Running missions stay running: another process takes them up, or this one at its next start.
        """
        await self.stop_vehicles()
        await self._succession.close()
        await self._failover.end()
        await self.stop_vehicles()  # of flights that one of these was just beginning
        if self._removing is not None:
            self._removing.cancel()
            await asyncio.gather(self._removing, return_exceptions=True)
        await self.logs.close()
        await self._processes.close()
        self.compute.end()
        await self.alarms.close()
        await self.maps.close()
        await self.traffic.close()
        await self.hub.close()
        await self._supervisor.close()
        await self._registry.close()
        await self.process.leave()
        self._written = True
        self._compilation.end()
        self._compiling.shutdown(wait=True, cancel_futures=True)
        self._threads.close()
        await self.compute.close()
        self.forecaster.close()
        self.previews.close()
        self.map_pictures.close()
        self._at_once.close()

    async def _taken_up(self, live: LiveMission) -> None:
        """Let the alarms of a mission that was taken up go out, then go on with it."""
        live.journal.alarms.watch = self.alarms
        self.alarms.listen(live.journal.alarms, live.spec.name)
        await self._failover.resume(live)

    @property
    def compiling(self) -> bool:
        """Whether what missions compute with is still being compiled."""
        return not self._compilation.done

    async def ready(self) -> tuple[bool, dict[str, str]]:
        """Tell whether requests can be served, and how each component is."""
        components = {"links": "ok" if self._started else "not started", "watch": self._failover.state}
        try:
            await self._database.ping()
            components["database"] = self._database.trouble or "ok"
        except Exception as error:
            components["database"] = f"cannot be reached: {error}"
        well = all(state == "ok" for state in components.values())
        if self.compute.state is not None:
            # Without the cluster everything is done all the same, later.
            components["compute"] = self.compute.state
        return well, components

    # Missions

    async def create(self, spec: MissionSpec, *, actor: str = "operator") -> MissionView:
        """Store a new mission; it is ready when it has a vehicle.

        Raises
        ------
        InvalidRequestError, ConflictError, NotAMemberError
            Nothing is stored then.
        """
        # Of thousands of lines that takes a while.
        await asyncio.to_thread(check_spec, spec, self.hub.kinds)
        await self.sites.check(spec)
        await self._succession.check(spec)
        row = _new_row(spec)
        await self._registry.try_out(row)
        async with self._database.writing() as session:
            session.add(row)
            await session.flush()
            session.add_all(vehicle_row(row.id, vehicle, slot) for slot, vehicle in enumerate(spec.vehicles))
            await set_site(session, row.id, spec.site)
            await self._registry.own(session, row.id)
        live = await self.get(row.id)
        await live.journal.log(Level.INFO, "state", f"created by {actor}", state=row.state, actor=actor)
        await _tell_of_lines(live)
        await self.sites.begin(live)
        return mission_view(live)

    async def missions(self) -> list[MissionSummary]:
        """Return every mission that no other process has, newest first."""
        # One that ended and left memory is as it was then: taking it up again for every list would be slow.
        ids = [one for (one,) in await self._at_once(mission_queries.ALL)]
        await self._registry.recall(ids)
        found = [self._registry.left(one) or await self._summary(one) for one in ids]
        return [summary for summary in found if summary is not None]

    async def _summary(self, mission_id: str) -> MissionSummary | None:
        try:
            return (await self.get(mission_id)).summary()
        except (MissionElsewhereError, MissionNotFoundError):
            return None
        except (SQLAlchemyError, OSError):
            raise
        except Exception:
            # One that cannot be read, as when a newer version wrote it, hides no other.
            log.exception("a mission cannot be listed", mission=mission_id)
            return None

    async def get(self, mission_id: str) -> LiveMission:
        """Return a mission. Raises MissionNotFoundError, MissionElsewhereError, MissionUnreadableError."""
        return await self._registry.get(mission_id)

    @property
    def database(self) -> Database:
        """What is stored, to be read."""
        return self._database

    async def rows(self, mission_id: str | None = None) -> Sequence[MissionRow]:
        """Return all missions as they are stored, oldest first, whoever has them; or the one of an id, if there is."""
        async with self._database.reading() as session:
            return await mission_queries.oldest_first(session, mission_id)

    async def at_sea(self) -> Sequence[MissionRow]:
        """Return the missions whose vehicles are out there, as they are stored, whoever has them."""
        async with self._database.reading() as session:
            return await mission_queries.in_states(session, AT_SEA)

    async def spec(self, mission_id: str) -> MissionSpec:
        """Return what a mission is to do, whoever has it. Raises MissionNotFoundError, MissionUnreadableError."""
        return await self._registry.spec(mission_id)

    async def check_exists(self, mission_id: str) -> None:
        """Raise MissionNotFoundError where there is no such mission; costs little, whoever has it."""
        await self._registry.check_exists(mission_id)

    async def act(
        self, live: LiveMission, action: Action, *, actor: str, note: str = "", return_home: bool | None = None
    ) -> ActionView:
        """Start, pause, resume, abort or finish a mission.

        ``return_home`` is whether vehicles go home first when it is finished or aborted; None: where the mission's
        recovery says so, and never when it is aborted.

        Raises
        ------
        MoveRefusedError, ConflictError
            The latter when a vehicle is not ready or takes part in another mission, none has a recovery point to go
            to, or the service ends and a flight would begin.
        """
        if action in (Action.START, Action.RESUME):
            self._supervisor.refuse_to_begin()
        stops_all = action in (Action.PAUSE, Action.ABORT) and not return_home
        if stops_all and live.header.state is MissionState.RUNNING and await self._supervisor.held_up(live):
            await self._supervisor.halt(live)
        async with self._supervisor.acting(live.id):
            target = states.move(live.header.state, action)
            stops: list[StopReceipt] = []
            nearby: list[str] = []
            if returns(live, action, return_home):
                await self._supervisor.bring_home(live, Ending(target, note, actor))
            elif action in (Action.START, Action.RESUME):
                self._claims.check_team(live)
                check_level_is_known(live)
                if action == Action.START:
                    self._claims.check_links(live)
                    # The site may have been surveyed since the mission was described.
                    await self.sites.begin(live)
                    # Also in the log: programs and consoles start missions without a look at the checklist.
                    nearby = [check.message for check in neighbour_checks(live, await self.at_sea())]
                    await self._claims.prepare(live, [member.spec for member in live.team])
                self._claims.claim_team(live)
                try:
                    await self._supervisor.set_state(live, target, note, actor, check=self._may_set_off(live))
                except BaseException:
                    if action == Action.START:
                        self._claims.release_team(live)
                    raise
                self._supervisor.run(live)
                for message in nearby:
                    await live.journal.log(Level.WARNING, "safety", message)
            else:
                stops = await self._supervisor.stand_down(live, target, note, actor)
                if target in ENDED:
                    self._supervisor.dismiss(live)
                live.publish_summary()
        return action_view(live, stops)

    async def start(self, live: LiveMission, confirmed: Sequence[str], *, actor: str, note: str = "") -> ActionView:
        """Start a mission, and keep in its log which questions of the checklist ``actor`` confirmed, and which not.

        Consoles that ask none start with it, too: the log says that nobody confirmed them.

        Raises InvalidRequestError for what is no question, else as :meth:`act`.
        """
        questions = self.settings.checklist
        for index, one in enumerate(confirmed):
            if one not in questions:
                known = "; ".join(questions) or "none: the setting checklist is empty"
                raise InvalidRequestError(
                    f"confirmed.{index}", f"the checklist does not ask {one!r}", f"its questions are: {known}"
                )
        found = await self.act(live, Action.START, actor=actor, note=note)
        looked_at = [question for question in questions if question in confirmed]
        open_ = [question for question in questions if question not in confirmed]
        if looked_at:
            await live.journal.log(Level.INFO, "safety", f"{actor} confirmed before the start: {'; '.join(looked_at)}")
        if open_:
            await live.journal.log(Level.WARNING, "safety", f"nobody confirmed before the start: {'; '.join(open_)}")
        return found

    def _may_set_off(self, live: LiveMission) -> Guard:
        """Return what refuses a transaction by which a mission goes to sea that must not."""
        free = free_elsewhere(live)

        async def check(session: AsyncSession) -> None:
            await free(session)
            # It may have begun to end since the mission was asked to start.
            self._supervisor.refuse_to_begin()

        return check

    async def _start_following(self, live: LiveMission, why: str) -> None:
        await self.act(live, Action.START, actor="service", note=why)

    async def send_on(self, live: LiveMission, name: str, actor: str) -> None:
        """Let a vehicle survey again that went home or was stopped. Raises VehicleNotFoundError, ConflictError."""
        await send_on(live, self._supervisor, name, actor)

    async def set_budget(self, live: LiveMission, budget: Budget, *, actor: str = "operator") -> MissionView:
        """Change how long a mission is that has not ended. Raises InvalidRequestError, ConflictError."""
        await set_budget(live, self._supervisor, budget, actor)
        return mission_view(live)

    async def describe_anew(self, live: LiveMission, spec: MissionSpec, *, actor: str = "operator") -> MissionView:
        """Describe a mission anew that has not started. Raises InvalidRequestError, ConflictError."""
        await asyncio.to_thread(check_spec, spec, self.hub.kinds)
        await self.sites.check(spec)
        await self._succession.check(spec, live.id, live.spec.after)
        await self._registry.try_out(_new_row(spec))
        async with self._supervisor.acting(live.id):
            await describe_anew(live, spec, actor)
            await self._registry.forget(live, "the mission was described anew")
        live = await self.get(live.id)
        await _tell_of_lines(live)
        await self.sites.begin(live)
        return mission_view(live)

    async def delete(self, live: LiveMission) -> None:
        """Remove a mission in which nothing was measured. Raises ConflictError."""
        async with self._supervisor.acting(live.id):
            await self._registry.delete(live)

    async def delete_stored(self, mission_id: str) -> None:
        """Remove a mission by its id, also one that cannot be opened.

        Raises
        ------
        MissionNotFoundError, MissionElsewhereError, ConflictError
            The latter when something was measured in it.
        """
        try:
            live = await self.get(mission_id)
        except MissionUnreadableError:
            async with self._supervisor.acting(mission_id):
                await self._registry.delete_unreadable(mission_id)
        else:
            await self.delete(live)

    def doctor(self) -> DoctorView:
        """Return what keeps IMC vehicles from working with us, as far as listening tells."""
        return doctor_view(self._examine(), traffic_findings(self.traffic))

    def ships(self) -> TrafficView:
        """Return the ships about, each with the vehicle that it comes closest to."""
        return traffic_view(self.traffic, self._registry)

    async def vehicles(self) -> list[VehicleView]:
        """Return every vehicle that is known, whether it takes part in a mission or not."""
        views = []
        for info, mission_id in self.hub.vehicles():
            member = None if mission_id is None else (await self.get(mission_id)).vehicles.of(info)
            views.append(member or idle_vehicle_view(info))
        return views


async def _tell_of_lines(live: LiveMission) -> None:
    """Log what is to be known of a mission's line plan before it is flown."""
    for remark in await asyncio.to_thread(line_remarks, live.spec):
        await live.journal.log(Level.WARNING, "lines", remark)


def _new_row(spec: MissionSpec) -> MissionRow:
    """Return a new mission as it is stored."""
    created = now()
    return MissionRow(
        id=str(uuid.uuid4()),
        name=spec.name,
        state=MissionState.READY if spec.vehicles else MissionState.DRAFT,
        reason="" if spec.vehicles else "no vehicle yet",
        # Its steps follow from its budget.
        spec=spec.model_dump(mode="json", exclude={"steps"}),
        created_at=created,
        updated_at=created,
        elapsed_s=0.0,
    )


async def _nobody(_password: str, _host: str, _own_user: bool) -> str | None:
    return None
