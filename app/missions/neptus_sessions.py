"""Sessions of Neptus' ConvCAO panel as missions: begun by its CONNECT, started by its START, fed by its steps."""

import socket
from collections.abc import Awaitable, Callable, Sequence
from statistics import median
from typing import Protocol

import numpy as np

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.errors import MissionError
from app.missions.fleet.links.neptus import NeptusFleetLink
from app.missions.live.mission import LiveMission
from app.missions.settings import NeptusSettings
from app.missions.spec.base import PolygonGeometry
from app.missions.spec.limits import Limits
from app.missions.spec.mission import MissionSpec, PlannerSpec
from app.missions.spec.vehicle import VehicleKind, VehicleSpec
from app.missions.spec.water import Tide
from app.missions.states import ENDED, Action, MissionState
from app.missions.views.mission import ActionView, Level, MissionView
from app.storage.database import Database
from app.storage.queries import events as event_queries
from app.storage.queries import missions as mission_queries
from imc_bridge.neptus import Area, Restored, SessionRefusedError, StepData
from imc_bridge.neptus.samples import looks_slanted

LogIn = Callable[[str, str, bool], Awaitable[str | None]]
"""Who logs in with a password from a host, and whether he runs this process himself; None: not let in."""

ARRIVAL_RADIUS_M = 1.0
"""The panel says itself when its vehicles have arrived; nothing is judged by distance here."""
STEP_DEADLINE_S = 86_400.0
"""The panel waits for its vehicles; a silent one is lost to us long before."""
WIDEST_BORDER = 0.25
"""Part of a small area's side that is left free at each border at most."""
EVENT = "neptus"
ENOUGH_RATIOS, MOST_RATIOS = 5, 15
"""Steps whose samples are compared with the vehicle's own altitude."""
FLYING = (MissionState.RUNNING, MissionState.PAUSED)


class Missions(Protocol):
    """What sessions need of :class:`app.missions.service.MissionService`, which has them."""

    async def create(self, spec: MissionSpec, *, actor: str) -> MissionView:
        """Store a new mission."""

    async def get(self, mission_id: str) -> LiveMission:
        """Return one."""

    async def act(self, live: LiveMission, action: Action, *, actor: str, note: str) -> ActionView:
        """Finish or abort one."""

    async def start(self, live: LiveMission, confirmed: Sequence[str], *, actor: str, note: str) -> ActionView:
        """Start one, of whose checklist some questions were confirmed."""


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
        self._ratios: dict[str, list[float]] = {}
        self._slanted: set[str] = set()
        """Whose samples were warned of."""
        self.link = NeptusFleetLink(settings, self)

    async def log_in(self, user: str, password: str, host: str, *, own_user: bool) -> str | None:
        """Return who that is; the user's name is the panel's, only the password counts.

        Raises SessionRefusedError with the reason where there is more to say than that the password is wrong.
        """
        try:
            return await self._log_in(password, host, own_user)
        except MissionError as error:
            raise SessionRefusedError(f"{error}; {error.remedy}") from error

    async def begin(self, session: str, vehicles: int, user: str, host: str) -> None:
        """Make the session's mission. What its console flew before ends when nothing is heard of it any more."""
        for old in self.link.sessions_of(host):
            if old != session and self._users.get(old) == user:
                self.link.begin(self._end_when_silent(old, f"its console began session {session}", user))
        spec = session_spec(self._settings, self.link.gateway.area, session, vehicles)
        try:
            mission = await self._service.create(spec, actor=user)
        except MissionError as error:
            raise SessionRefusedError(f"{error}; {error.remedy}") from error
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
        await self._log(session, Level.INFO, EVENT + "-map", words)

    async def step(self, data: StepData, user: str, host: str, *, answered: bool) -> None:
        """Hand a step to the mission, and start it with the first one."""
        mission_id = self._missions[data.session]
        try:
            mission = await self._service.get(mission_id)
            state = mission.header.state
            if state in ENDED:
                raise SessionRefusedError(f"the session's mission is {state}: press STOP, then RENEW for another one")
            self.link.locate(data, host)
            if state is MissionState.READY:
                await self._service.start(mission, (), actor=user, note="START in the panel")
        except MissionError as error:
            raise SessionRefusedError(f"{error}; {error.remedy}") from error
        await self._warn_of_border(data)
        await self._warn_of_slants(data)
        refused = "; ".join(f"{count} {reason}" for reason, count in sorted(data.refused.items()))
        words = f"step {data.time_step}: {len(data.soundings)} soundings" + (f", refused {refused}" if refused else "")
        await self._note(data.session, Level.INFO, words, data.time_step, host)
        self.link.take(data, answered=answered)

    async def refused(self, session: str, reason: str) -> None:
        """Write into the mission's log what the panel was told, which it shows to nobody."""
        if session in self._missions:
            await self._log(session, Level.WARNING, EVENT + "-refused", reason)

    def polled(self, session: str, *, answered: bool) -> None:
        """Note that the panel polled, and whether it got the answer to its last step."""
        self.link.polled(session, answered=answered)

    async def may_repeat(self, session: str, time_step: int) -> bool:
        """Tell whether a panel that waits for the answer to a step that never came is to be told to stay."""
        mission_id = self._missions.get(session)
        if mission_id is None:
            return True  # its own file was lost: it begins with the next step
        mission = await self._service.get(mission_id)
        if mission.header.state in ENDED:
            return False
        await mission.journal.log(
            Level.WARNING,
            EVENT + "-repeat",
            f"the panel waits for the answer to step {time_step}, which was lost or refused: its vehicles stay where "
            "they are, and it goes on with the next one",
        )
        return True

    async def _warn_of_border(self, data: StepData) -> None:
        area = self.link.gateway.area
        for index, place in enumerate(data.places):
            name = vehicle_name(data.session, index)
            if area.on_border(place.row, place.col) and name not in self._warned:
                self._warned.add(name)
                await self._log(
                    data.session,
                    Level.WARNING,
                    EVENT + "-border",
                    f"{name} is on the border of the area, where the panel puts whatever lies outside: "
                    "is Area Center the same here and there?",
                    vehicle=name,
                )

    async def _warn_of_slants(self, data: StepData) -> None:
        """Say when samples look like those of an altimeter, which the panel takes for a slanted beam."""
        for index, ratio in enumerate(data.altitude_ratios):
            name = vehicle_name(data.session, index)
            ratios = self._ratios.setdefault(name, [])
            if ratio is None or len(ratios) >= MOST_RATIOS or name in self._slanted:
                continue
            ratios.append(ratio)
            if len(ratios) >= ENOUGH_RATIOS and looks_slanted(median(ratios)):
                self._slanted.add(name)
                await self._log(
                    data.session,
                    Level.WARNING,
                    EVENT + "-samples",
                    f"the samples of {name} have it {100 * (1 - median(ratios)):.0f} % nearer to the bottom than it "
                    "has itself: the panel takes an altimeter for a slanted beam. Without a DVL set neptus.samples "
                    "to off",
                    vehicle=name,
                )

    async def _end_when_silent(self, session: str, reason: str, user: str) -> None:
        """Finish what a console flew that has begun another session; a second console's goes on while it flies."""
        await self.link.until_silent(session)
        self.link.supersede(session)
        await self._finish(session, reason, user)

    async def _finish(self, session: str, reason: str, user: str) -> None:
        mission_id = self._missions.get(session)
        if mission_id is None:
            return
        mission = await self._service.get(mission_id)
        if mission.header.state not in ENDED:
            action = Action.FINISH if mission.header.state in FLYING else Action.ABORT
            await self._service.act(mission, action, actor=user, note=reason)

    async def _log(self, session: str, level: Level, kind: str, message: str, /, **data: str | float) -> None:
        """Write a line of the log of the session's mission."""
        await (await self._service.get(self._missions[session])).journal.log(level, kind, message, **data)

    async def _note(self, session: str, level: Level, message: str, time_step: int, host: str) -> None:
        await self._log(
            session,
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
    ring = [(lon, lat) for lat, lon in _corners(area)]
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
            border_margin_m=min(settings.border_m, WIDEST_BORDER * settings.cell_m * min(settings.rows, settings.cols)),
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


def _corners(area: Area) -> list[tuple[float, float]]:
    """Return the area's corners in degrees, drawn in so little that its map has the panel's rows and columns.

    The panel's axes are those of its centre, the map's those of a corner, a little turned: by millimetres more than a
    whole number of cells, the map would have one more.
    """
    corners = area.corners()
    frame = LocalFrame(min(lat for lat, _ in corners), min(lon for _, lon in corners))
    east, north = frame.to_local(*(np.array(values) for values in zip(*corners, strict=True)))
    excess_m = max(np.ptp(east) - area.cols * area.cell_m, np.ptp(north) - area.rows * area.cell_m, 0.0)
    in_by = excess_m / area.cell_m / 2
    rows, cols = (in_by, area.rows - in_by), (in_by, area.cols - in_by)
    return [area.to_geographic(rows[i], cols[j]) for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))]
