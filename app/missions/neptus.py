"""Sessions of Neptus' ConvCAO panel as missions: begun by its CONNECT, started by its START, fed by its steps."""

import socket
from collections.abc import Awaitable, Callable
from typing import Protocol

from app.missions.errors import MissionError
from app.missions.links.neptus import NeptusFleetLink
from app.missions.settings import NeptusSettings
from app.missions.spec import Limits, MissionSpec, PlannerSpec, Tide, VehicleKind, VehicleSpec
from app.missions.spec_base import PolygonGeometry
from app.missions.states import ENDED, Action, MissionState
from app.missions.views import ActionView, Level, MissionView
from app.storage import events as event_queries
from app.storage import missions as mission_queries
from app.storage.database import Database
from imc_bridge.neptus import Area, Restored, SessionRefusedError, StepData

LogIn = Callable[[str, str, bool], Awaitable[str | None]]
"""Who logs in with a password from a host, and whether he runs this process himself; None: not let in."""

ARRIVAL_RADIUS_M = 1.0
"""The panel says itself when its vehicles have arrived; nothing is judged by distance here."""
STEP_DEADLINE_S = 86_400.0
"""The panel waits for its vehicles; a silent one is lost to us long before."""
EVENT = "neptus"
FLYING = (MissionState.RUNNING, MissionState.PAUSED)


class Missions(Protocol):
    """What sessions need of :class:`app.missions.service.MissionService`, which has them."""

    async def create(self, spec: MissionSpec, *, actor: str) -> MissionView:
        """Store a new mission."""

    async def mission(self, mission_id: str) -> MissionView:
        """Return one."""

    async def act(self, mission_id: str, action: Action, *, actor: str, note: str) -> ActionView:
        """Start, finish or abort one."""

    async def note(self, mission_id: str, level: Level, kind: str, message: str, **data: str | float) -> None:
        """Write a line of its log."""


class NeptusSessions:
    """Turns what the panel uploads into missions' lives; see :class:`imc_bridge.neptus.SessionKeeper`."""

    def __init__(
        self,
        service: Missions,
        database: Database,
        settings: NeptusSettings,
        log_in: LogIn,
        is_own_user: Callable[[socket.socket], bool],
    ) -> None:
        self._service = service
        self._database = database
        self._settings = settings
        self._log_in = log_in
        self.is_own_user = is_own_user
        self._missions: dict[str, str] = {}
        self._users: dict[str, str] = {}
        self._warned: set[str] = set()
        self.link = NeptusFleetLink(settings, self)

    async def log_in(self, user: str, password: str, host: str, *, own_user: bool) -> str | None:
        """Return who that is; the user's name is the panel's, only the password counts."""
        return await self._log_in(password, host, own_user)

    async def begin(self, session: str, vehicles: int, user: str, host: str) -> None:
        """Make the session's mission. What its console flew before is over."""
        for old in self.link.supersede(session, host):
            await self._finish(old, f"its console began session {session}", user)
        spec = session_spec(self._settings, self.link.gateway.area, session, vehicles)
        try:
            mission = await self._service.create(spec, actor=user)
        except MissionError as error:
            raise SessionRefusedError(f"{error}. {error.remedy}") from error
        self._missions[session] = mission.id
        self._users[session] = user
        self.link.add(session, [vehicle.name for vehicle in spec.vehicles], host)
        await self._note(session, Level.INFO, f"{user} connected with {vehicles} vehicles", 0, host)

    async def restore(self, session: str) -> Restored | None:
        """Find a session that an earlier run of the service took up and that goes on."""
        async with self._database.reading() as reading:
            row = await mission_queries.newest_named(reading, session)
            event = await event_queries.newest_of_kind(reading, row.id, EVENT) if row is not None else None
        if row is None or event is None or MissionState(row.state) in ENDED:
            return None
        names = [vehicle["name"] for vehicle in row.spec["vehicles"]]
        restored = Restored(event.data["user"], frozenset({event.data["host"]}), len(names), event.data["time_step"])
        if not self.link.knows(session):
            self._missions[session] = row.id
            self._users[session] = restored.user
            self.link.add(session, names, event.data["host"], time_step=restored.time_step)
        return restored

    async def prior_map(self, session: str, cells: list[tuple[int, int, float]]) -> None:
        """Take the sparse map in, or only say that it came."""
        if session not in self._missions:
            raise SessionRefusedError("the session's own file comes before its map")
        use, settings = self._settings.prior_map, self._settings
        inside = [cell for cell in cells if cell[0] < settings.rows and cell[1] < settings.cols]
        if use == "ignore":
            words = f"a sparse map with {len(cells)} known cells came and is not used (neptus.prior_map)"
        else:
            depths = [(r, c, value if use == "depth" else settings.max_depth_m - value) for r, c, value in inside]
            taken = [cell for cell in depths if cell[2] > 0.0]
            self.link.prior(session, taken)
            words = f"{len(taken)} cells of a sparse map with {len(cells)} known ones are used as depths"
        await self._service.note(self._missions[session], Level.INFO, EVENT + "-map", words)

    async def step(self, data: StepData, user: str, host: str) -> None:
        """Hand a step to the mission, and start it with the first one."""
        mission_id = self._missions[data.session]
        try:
            state = (await self._service.mission(mission_id)).state
            if state in ENDED:
                raise SessionRefusedError(f"the session's mission is {state}: press STOP, then RENEW for another one")
            self.link.locate(data, host)
            if state is MissionState.READY:
                await self._service.act(mission_id, "start", actor=user, note="START in the panel")
        except MissionError as error:
            raise SessionRefusedError(f"{error}. {error.remedy}") from error
        await self._warn_of_border(data)
        refused = "; ".join(f"{count} {reason}" for reason, count in sorted(data.refused.items()))
        words = f"step {data.time_step}: {len(data.soundings)} soundings" + (f", refused {refused}" if refused else "")
        await self._note(data.session, Level.INFO, words, data.time_step, host)
        self.link.take(data)

    async def refused(self, session: str, reason: str) -> None:
        """Write into the mission's log what the panel was told, which it shows to nobody."""
        if session in self._missions:
            await self._service.note(self._missions[session], Level.WARNING, EVENT + "-refused", reason)

    def fetched(self, session: str) -> None:
        """Note that the newest answer was fetched."""
        self.link.fetched(session)

    async def _warn_of_border(self, data: StepData) -> None:
        area = self.link.gateway.area
        for index, place in enumerate(data.places):
            name = vehicle_name(data.session, index)
            if area.on_border(place.row, place.col) and name not in self._warned:
                self._warned.add(name)
                await self._service.note(
                    self._missions[data.session],
                    Level.WARNING,
                    EVENT + "-border",
                    f"{name} is on the border of the area, where the panel puts whatever lies outside: "
                    "is Area Center the same here and there?",
                    vehicle=name,
                )

    async def _finish(self, session: str, reason: str, user: str) -> None:
        mission_id = self._missions.get(session)
        state = (await self._service.mission(mission_id)).state if mission_id is not None else None
        if mission_id is None or state in ENDED:
            return
        await self._service.act(mission_id, "finish" if state in FLYING else "abort", actor=user, note=reason)

    async def _note(self, session: str, level: Level, message: str, time_step: int, host: str) -> None:
        await self._service.note(
            self._missions[session],
            level,
            EVENT,
            message,
            session=session,
            time_step=time_step,
            user=self._users[session],
            host=host,
        )


def vehicle_name(session: str, index: int) -> str:
    """Name of a session's vehicle; the panel tells only how many there are."""
    return f"{session}-{index + 1}"


def session_spec(settings: NeptusSettings, area: Area, session: str, vehicles: int) -> MissionSpec:
    """The mission of a session, as the settings describe it."""
    ring = [(lon, lat) for lat, lon in area.corners()]
    depths = [settings.first_depth_m + index * settings.depth_separation_m for index in range(vehicles)]
    return MissionSpec(
        name=session,
        area=PolygonGeometry(coordinates=[[*ring, ring[0]]]),
        vehicles=[
            VehicleSpec(name=vehicle_name(session, index), kind=VehicleKind.NEPTUS, depth_m=depth)
            for index, depth in enumerate(depths)
        ],
        steps=settings.steps,
        cell_m=settings.cell_m,
        limits=Limits(
            max_step_m=settings.max_step_m,
            min_depth_m=depths[0],
            max_depth_m=max(depths[-1], 0.1),
            min_altitude_m=settings.min_altitude_m,
            min_vertical_separation_m=settings.depth_separation_m,
        ),
        planner=PlannerSpec(name=settings.planner),
        arrival_radius_m=ARRIVAL_RADIUS_M,
        step_deadline_s=STEP_DEADLINE_S,
        tide=Tide(level_m=0.0, source="subtracted by Neptus, by its own tide table"),
    )
