"""Both endpoints and the sessions between them."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import CancelledError as FutureCancelledError
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

from imc_bridge.neptus.ftp import FtpCalls, FtpEndpoint, FtpUpload, LogInRefusedError
from imc_bridge.neptus.http import HttpEndpoint, listening_socket
from imc_bridge.neptus.protocol import NeptusDataError, count_vehicles, read_map, read_session, read_step, write_actions
from imc_bridge.neptus.values import Area, CellPosition, Conventions, StepData
from imc_bridge.network.transport import PortInUseError

MAX_SESSIONS = 100
ANSWER_WITHIN_S = 20.0
LOOK_AGAIN_S = 2.0
MAX_LOOKED_FOR = 64
POLLS_STOP_S = 2.0
"""The panel polls ten times a second; after such a gap it was flying, or the network was gone."""

log = logging.getLogger(__name__)


class SessionRefusedError(Exception):
    """A log-in, a session or a step is not taken; ``str()`` says why and what to do."""


@dataclass(frozen=True, slots=True)
class GatewaySettings:
    """Where the endpoints listen, and what the panel's figures mean."""

    conventions: Conventions
    host: str = "127.0.0.1"
    ftp_port: int = 21
    http_port: int = 80
    passive_ports: tuple[int, int] | None = None
    public_address: str | None = None
    repeat_after_s: float = 5.0
    """A panel that polls for this long while no step of its own is to be answered is freed; see NeptusGateway."""


@dataclass(frozen=True, slots=True)
class Restored:
    """A session of an earlier run of the process."""

    user: str
    hosts: frozenset[str]
    vehicles: int
    time_step: int


class SessionKeeper(Protocol):
    """Who knows what sessions are for; called from the event loop."""

    def is_own_user(self, connection: socket.socket) -> bool:
        """Return whether a connection just accepted belongs to the user who runs this process; any thread."""
        ...

    async def log_in(self, user: str, password: str, host: str, *, own_user: bool) -> str | None:
        """Return the user; None: not admitted. Raises SessionRefusedError with the reason."""
        ...

    async def begin(self, session: str, vehicles: int, user: str, host: str) -> None:
        """Take up a session. Raises SessionRefusedError."""
        ...

    async def restore(self, session: str) -> Restored | None:
        """Return what is known of a session from an earlier run."""
        ...

    async def prior_map(self, session: str, cells: list[tuple[int, int, float]]) -> None:
        """Take the sparse map that the panel sends with its session."""
        ...

    async def step(self, data: StepData, user: str, host: str, *, answered: bool) -> None:
        """Take a step; its answer is given with :meth:`NeptusGateway.answer`. Raises SessionRefusedError.

        ``answered``: it came so late that the panel was sent a stay meanwhile, and waits for nothing.
        """
        ...

    async def refused(self, session: str, reason: str) -> None:
        """Hear that an upload of a session was refused."""
        ...

    def polled(self, session: str, *, answered: bool) -> None:
        """Hear that the panel polled, and whether it got the answer to its last step."""
        ...

    async def may_repeat(self, session: str, time_step: int) -> bool:
        """Return whether a panel that waits for the answer to a step that never came needs the answer to stay."""
        ...


@dataclass(slots=True)
class _Session:
    name: str
    user: str
    hosts: set[str]
    vehicles: int = 0
    time_step: int = 0
    pairs: bool = False
    answered: int = 0
    places: list[CellPosition] = field(default_factory=list)
    """Of the last answer."""
    last: StepData | None = None
    polls_since_s: float = 0.0
    """When the panel began to poll without a break, or was served the newest answer first; the event loop's time."""
    served: int = -1
    polled_s: float = float("-inf")
    stepping: asyncio.Lock = field(default_factory=asyncio.Lock)


class NeptusGateway:
    """An FTP and an HTTP endpoint that look to Neptus' ConvCAO panel like the service it was written for.

    A session belongs to the user that made its folder; its answers are served only to hosts that logged in for it: the
    panel sends no password with HTTP.

    The panel uploads each step once, looks at no reply, and polls until an answer comes whose ``timeStep`` is not less
    than its own. An upload that was lost or refused would leave it waiting for ever. So after some seconds of polls
    that wait for nothing we know of, the last places are laid out once more, as the answer to the next step.

    Parameters
    ----------
    settings
    keeper
    """

    def __init__(self, settings: GatewaySettings, keeper: SessionKeeper) -> None:
        self._settings = settings
        self._keeper = keeper
        self._sessions: dict[str, _Session] = {}
        self._looked_for: dict[str, float] = {}
        self._tasks: set[asyncio.Task[Any]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ftp: FtpEndpoint | None = None
        self._http: HttpEndpoint | None = None
        self.ftp_port = settings.ftp_port
        self.http_port = settings.http_port

    @property
    def area(self) -> Area:
        """The rectangle that the panel's cells are counted in."""
        return self._settings.conventions.area

    async def start(self) -> None:
        """Bind both ports and answer.

        Raises
        ------
        imc_bridge.network.transport.PortInUseError
            Saying which port cannot be had and what to do.
        """
        settings = self._settings
        self._loop = asyncio.get_running_loop()
        calls = FtpCalls(
            self._keeper.is_own_user,
            self._log_in,
            self._make,
            self._receive,
            lambda session: session in self._sessions,
        )
        try:
            listening = listening_socket(settings.host, settings.http_port)
        except OSError as error:
            raise _port_error("HTTP", settings.host, settings.http_port, error) from error
        try:
            self._ftp = FtpEndpoint(
                settings.host,
                settings.ftp_port,
                calls,
                passive_ports=settings.passive_ports,
                public_address=settings.public_address,
            )
        except OSError as error:
            listening.close()
            raise _port_error("FTP", settings.host, settings.ftp_port, error) from error
        self.http_port = listening.getsockname()[1]
        self.ftp_port = self._ftp.port
        self._http = HttpEndpoint(listening, self._answer)
        self._http.start()
        self._ftp.start()

    async def close(self) -> None:
        """Release both ports; safe to repeat."""
        if self._ftp is not None:
            # Its thread may be waiting for this loop.
            await asyncio.to_thread(self._ftp.stop)
            self._ftp = None
        if self._http is not None:
            await self._http.stop()
            self._http = None
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def answer(self, session: str, time_step: int, places: list[CellPosition]) -> None:
        """Lay out where the vehicles shall go, in the panel's order; nothing happens for an unknown session."""
        known = self._sessions.get(session)
        if known is not None:
            known.places, known.answered = places, max(time_step, known.answered)

    # The HTTP side, on the event loop

    def _answer(self, session: str, host: str) -> bytes | None:
        known = self._sessions.get(session)
        if known is None:
            self._look_for(session, host)
            return None
        if host not in known.hosts:
            return None
        now_s = self._now_s()
        if now_s - known.polled_s > POLLS_STOP_S or known.served != known.answered:
            known.polls_since_s, known.served = now_s, known.answered
        known.polled_s = now_s
        self._keeper.polled(session, answered=0 < known.time_step <= known.answered)
        if self._waits_in_vain(known, now_s):
            known.polls_since_s = now_s
            self._begin(self._repeat(known))
        # A file that is not there makes the panel write an error into its log ten times a second.
        return write_actions(session, known.answered, known.places, self.area, pairs=known.pairs)

    def _waits_in_vain(self, known: _Session, now_s: float) -> bool:
        """Tell whether the panel waits for the answer to a step that we have not."""
        nothing_due = known.answered >= known.time_step and not known.stepping.locked()
        return nothing_due and now_s - known.polls_since_s >= self._settings.repeat_after_s

    async def _repeat(self, known: _Session) -> None:
        """Free the panel: the last places once more, as the answer to the step after the last one."""
        async with known.stepping:
            time_step = known.answered + 1
            if known.time_step < time_step and await self._keeper.may_repeat(known.name, time_step):
                known.answered = time_step

    @staticmethod
    def _now_s() -> float:
        return asyncio.get_running_loop().time()

    def _look_for(self, session: str, host: str) -> None:
        """See whether a session is one of an earlier run, for which the panel is still waiting."""
        now = time.monotonic()
        if now - self._looked_for.get(session, -LOOK_AGAIN_S) < LOOK_AGAIN_S:
            return
        if len(self._looked_for) >= MAX_LOOKED_FOR:
            self._looked_for.clear()
        self._looked_for[session] = now

        async def look() -> None:
            restored = await self._keeper.restore(session)
            if restored is not None and host in restored.hosts:
                self._take_up(session, restored)

        self._begin(look())

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _take_up(self, session: str, restored: Restored) -> _Session:
        known = self._sessions.get(session)
        if known is None:
            known = self._sessions[session] = _Session(session, restored.user, set(restored.hosts))
            known.vehicles = restored.vehicles
            known.time_step = restored.time_step
            # The mission repeats the answer to its last step, if there was one, when it goes on.
            known.answered = max(restored.time_step - 1, 0)
            self._forget_some()
        return known

    # The FTP side, from its thread

    def _log_in(self, user: str, password: str, host: str, own_user: bool) -> str | None:
        try:
            principal: str | None = self._ask(self._keeper.log_in(user, password, host, own_user=own_user))
        except SessionRefusedError as refused:
            raise LogInRefusedError(" ".join(str(refused).split())) from None
        except Exception:
            log.exception("A log-in could not be judged")
            return None
        return principal

    def _make(self, user: str, host: str, session: str) -> str:
        return self._say(self._make_session(user, host, session))

    def _receive(self, upload: FtpUpload) -> str:
        return self._say(self._take(upload))

    def _say(self, work: Coroutine[Any, Any, None]) -> str:
        try:
            self._ask(work)
        except (SessionRefusedError, NeptusDataError) as refused:
            return " ".join(str(refused).split())
        except Exception:
            log.exception("An upload of Neptus could not be handled")
            return "It could not be handled; the service's log says why"
        return ""

    def _ask(self, work: Coroutine[Any, Any, Any]) -> Any:
        loop = self._loop
        if loop is None or loop.is_closed():
            work.close()
            raise SessionRefusedError("the service is shutting down")
        future = asyncio.run_coroutine_threadsafe(work, loop)
        try:
            return future.result(ANSWER_WITHIN_S)
        except FutureCancelledError:
            raise SessionRefusedError("the service is shutting down") from None
        except TimeoutError:
            future.cancel()
            raise SessionRefusedError("the service is busy; try again") from None

    # Sessions, on the event loop

    async def _make_session(self, user: str, host: str, session: str) -> None:
        if session in self._sessions or await self._keeper.restore(session) is not None:
            raise SessionRefusedError(f"session {session} exists already: press RENEW for another one")
        self._sessions[session] = _Session(session, user, {host})
        self._forget_some()

    def _forget_some(self) -> None:
        while len(self._sessions) > MAX_SESSIONS:
            del self._sessions[next(iter(self._sessions))]

    async def _take(self, upload: FtpUpload) -> None:
        session, what = _meant(upload)
        known = self._sessions.get(session)
        if known is None:
            restored = await self._keeper.restore(session)
            if restored is None:
                raise SessionRefusedError(f"there is no session {session}: press RENEW and connect again")
            known = self._take_up(session, restored)
        if known.user != upload.user:
            raise SessionRefusedError(f"session {session} belongs to someone else")
        known.hosts.add(upload.host)
        async with known.stepping:
            try:
                await what(self, known, upload)
            except (SessionRefusedError, NeptusDataError) as refused:
                await self._keeper.refused(session, f"{upload.name} was refused: {refused}")
                raise

    async def _take_begin(self, known: _Session, upload: FtpUpload) -> None:
        if known.vehicles:
            raise SessionRefusedError(f"session {known.name} has begun already: press RENEW for another one")
        vehicles = read_session(upload.content, known.name)
        await self._keeper.begin(known.name, vehicles, upload.user, upload.host)
        known.vehicles = vehicles

    async def _take_step(self, known: _Session, upload: FtpUpload) -> None:
        if not known.vehicles:
            # Its own file was lost, which the panel does not know.
            vehicles = await asyncio.to_thread(count_vehicles, upload.content, known.name)
            await self._keeper.begin(known.name, vehicles, upload.user, upload.host)
            known.vehicles = vehicles
        # A step may hold thousands of samples: read beside the loop.
        conventions = self._settings.conventions
        read = partial(read_step, upload.content, known.name, known.vehicles, conventions, known.last)
        data = await asyncio.to_thread(read)
        if data.time_step < known.time_step:
            raise NeptusDataError("timeStep", f"{data.time_step} came after {known.time_step}: steps count up")
        if data.time_step == known.time_step:
            # The panel missed the confirmation and sends it again; the answer stays.
            return
        known.pairs = data.pairs
        await self._keeper.step(data, upload.user, upload.host, answered=data.time_step <= known.answered)
        known.time_step, known.last = data.time_step, data

    async def _take_map(self, known: _Session, upload: FtpUpload) -> None:
        cells = await asyncio.to_thread(read_map, upload.content)
        await self._keeper.prior_map(known.name, cells)


_Taking = Callable[[NeptusGateway, _Session, FtpUpload], Coroutine[Any, Any, None]]
DATA_END = "_Data.txt"
SESSION_END = ".txt"


def _meant(upload: FtpUpload) -> tuple[str, _Taking]:
    """Return the session that an upload is of, and what takes it."""
    if upload.folder:
        return upload.folder, NeptusGateway._take_map
    if upload.name.endswith(DATA_END):
        return upload.name.removesuffix(DATA_END), NeptusGateway._take_step
    return upload.name.removesuffix(SESSION_END), NeptusGateway._take_begin


def _port_error(kind: str, host: str, port: int, error: OSError) -> PortInUseError:
    remedy = (
        "ports below 1024 need a privilege: see docs/neptus.md, or set others and redirect these"
        if isinstance(error, PermissionError)
        else "stop what listens there, or set another address or port"
    )
    return PortInUseError(f"the Neptus gateway cannot listen for {kind} on {host}:{port} ({error.strerror}): {remedy}")
