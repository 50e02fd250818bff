"""The application: every part put together, opened at the start and closed at the end."""

import asyncio
import os
import socket
import sys
import warnings
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import lru_cache, partial
from pathlib import Path
from types import FrameType

import structlog
import uvicorn
from fastapi import FastAPI
from fastapi_offline import FastAPIOffline
from starlette.middleware.cors import CORSMiddleware

from app import __version__
from app.api import logs
from app.api.access import audit_routes, sign_in
from app.api.access.address_key import AddressKeyMiddleware
from app.api.access.auth import console_log_in
from app.api.access.shares import ShareMiddleware
from app.api.accounts.audit_log import AuditLog, AuditMiddleware
from app.api.accounts.peers import is_own_user
from app.api.accounts.quotas import Shares
from app.api.accounts.rates import LimitMiddleware, RequestLimits
from app.api.accounts.roles import Role
from app.api.accounts.sessions import SessionStore
from app.api.accounts.tokens import TokenStore
from app.api.bodies.admission import BodyMiddleware
from app.api.bodies.budget import BodyBudget
from app.api.bodies.intake import Intakes
from app.api.bodies.unread import UnreadBodyMiddleware
from app.api.health import health_router
from app.api.http import error_handlers, openapi
from app.api.maps import maps, profiles, sites, tiles
from app.api.maps.ogc import routes as features
from app.api.maps.wms import routes as web_maps
from app.api.middleware.addresses import AddressMiddleware
from app.api.middleware.connections import Sockets, is_shared_host, patient_http
from app.api.middleware.direct import DirectRoutes
from app.api.middleware.forwarding import ForwardingMiddleware, PeerMiddleware
from app.api.middleware.requests import RequestMiddleware
from app.api.missions import alarms, fleet, forecasts, missions, orders, searches, streams, targets
from app.api.schemas import API
from app.api.soundings import beams, corrections, imports, measurements, pings, soundings
from app.api.state import EdgeState
from app.certificates import first_certificate, when_not_valid
from app.dashboard.serve import mount_dashboard
from app.descriptors import allow_descriptors
from app.end_signals import EndSignals
from app.malloc import keep_memory_together, settled
from app.missions import clock
from app.missions.service import MissionService
from app.named_files import unusable_certificate
from app.settings import Settings, StartupError, is_loopback, load_settings
from app.storage.database import Database
from app.storage.processes.membership import MembershipLostError
from app.storage.queries.audit import Command
from app.storage.upkeep.prepare import folder_of, prepare_database
from app.supervision import SystemdNotifier
from imc_bridge import PortInUseError

SWITCH_S = 0.001
"""How soon a thread gets its turn: planners in threads give theirs up at each of many short calls."""

GRACE_S = 5
"""Seconds that open requests get to end when the process is asked to."""
MAX_VIEWER_MESSAGE_BYTES = 4096

log = structlog.get_logger(__name__)

# FastAPI hands pydantic aliases where they mean nothing; whoever runs the service can do nothing about it.
warnings.filterwarnings("ignore", message=r"The 'alias' attribute with value .* was provided to the `Field")


ROUTERS = (
    missions.router,
    sites.router,
    sites.mission_router,
    forecasts.router,
    measurements.router,
    corrections.router,
    imports.router,
    imports.charts_router,
    maps.router,
    profiles.router,
    maps.layers_router,
    tiles.router,
    tiles.tile_router,
    features.router,
    web_maps.router,
    soundings.router,
    pings.router,
    beams.router,
    targets.router,
    searches.router,
    streams.router,
    fleet.router,
    orders.router,
    alarms.router,
    audit_routes.router,
    sign_in.router,
    health_router(API),
)
"""In the order in which a request's path is looked for."""


def create_app(settings: Settings | None = None, *, port: int | None = None) -> FastAPI:
    """Return the application.

    Without ``settings`` they are read from the environment and ``bathyfleet.toml``. ``port``: where it is served, if
    that is not the port of the settings.
    """
    settings = settings or load_settings()
    limits = RequestLimits(settings.max_requests_per_s, settings.max_failed_logins)
    if not structlog.is_configured():
        logs.configure(settings.log_level, settings.log_format)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        await prepare_database(settings.database_url, may_upgrade=settings.migrates_itself)
        database = Database(settings.database_url)
        try:
            tokens = TokenStore(database)
            if not (settings.loopback or settings.insecure or await tokens.any()):
                raise StartupError(
                    f"host is {settings.host}, which other machines reach, but there is no access token: "
                    "make one with 'bathyfleet token create NAME --role operator', or allow everyone with --insecure"
                )
            if settings.neptus.enabled and not (
                is_loopback(settings.neptus.host) or settings.insecure or await tokens.any()
            ):
                raise StartupError(
                    f"neptus.host is {settings.neptus.host}, which other machines reach, but there is no access token: "
                    "make one with 'bathyfleet token create NAME --role operator'; it is the panel's password"
                )
            audit = AuditLog(database, settings.audit_days)

            async def log_in(password: str, host: str, own_user: bool) -> str | None:
                name = await console_log_in(
                    tokens, limits, password, host, own_user=own_user, insecure=settings.insecure
                )
                if name is None:  # who is let in is in the log of his session's mission
                    await audit.write(Command("", "", host, "log in", "Neptus gateway", "refused"))
                return name

            service = MissionService(
                settings,
                database,
                log_in,
                is_own_user=is_own_user,
                url=settings.peer_url or _own_url(settings, port or settings.port),
                certificate=first_certificate(settings.tls_certificate) if settings.tls_certificate else None,
            )
            app.state.edge = EdgeState(settings, service, tokens, limits, audit, SessionStore(database))
            await tokens.exists("")  # so that they are known when it matters
            try:
                await _begin(service)
                yield
            finally:
                app.state.edge.stopping.set()
                await service.shutdown()
                await app.state.edge.peers.close()
                tokens.close()
                app.state.edge.sessions.close()
        finally:
            await database.close()

    app = FastAPIOffline(
        title="bathyfleet",
        summary="Maps the sea floor with a fleet of AUVs",
        description=openapi.DESCRIPTION,
        version=__version__,
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        openapi_url="/api/openapi.json",
        docs_url="/api/docs",
        redoc_url=None,
        swagger_ui_oauth2_redirect_url="/api/docs/oauth2-redirect",
        static_url="/api/docs-assets",
        openapi_tags=openapi.TAGS,
        lifespan=lifespan,
    )
    for router in ROUTERS:
        app.include_router(router)
    app.include_router(health_router(""), include_in_schema=False)
    mount_dashboard(app, charts=settings.charts)
    error_handlers.install(app)
    openapi.install(app)
    _add_middleware(app, settings, limits)
    return app


def _add_middleware(app: FastAPI, settings: Settings, limits: RequestLimits) -> None:
    """Add what requests pass through, from the inside out."""
    app.add_middleware(DirectRoutes, routers=ROUTERS)
    app.add_middleware(ForwardingMiddleware)
    app.add_middleware(
        BodyMiddleware,
        intakes=Intakes(ROUTERS),
        budget=BodyBudget(settings.bytes_in_flight),
        max_bytes=settings.max_body_bytes,
        max_file_bytes=settings.max_import_bytes,
        patience_s=settings.slow_client_s,
    )
    if settings.allowed_origins:
        # Outside of the former, so that pages of these origins can read why they were refused.
        app.add_middleware(
            CORSMiddleware, allow_origins=settings.allowed_origins, allow_methods=["*"], allow_headers=["*"]
        )
    app.add_middleware(AuditMiddleware)
    app.add_middleware(LimitMiddleware, limits=limits)
    app.state.shares = Shares(settings.max_connections)
    app.add_middleware(ShareMiddleware, shares=app.state.shares)
    app.add_middleware(PeerMiddleware)
    app.add_middleware(RequestMiddleware)
    app.add_middleware(UnreadBodyMiddleware)
    app.add_middleware(AddressKeyMiddleware)
    app.add_middleware(AddressMiddleware, proxies=settings.trusted_proxies)


async def _begin(service: MissionService) -> None:
    """Start the service; raise StartupError where something outside of it is in the way."""
    try:
        await service.startup()
    except PortInUseError as error:
        raise StartupError(str(error)) from None
    except MembershipLostError as error:
        raise StartupError(f"this process cannot join those on its database: {error}") from None


def _own_url(settings: Settings, port: int) -> str:
    """Return where other processes on the same database reach this one, as far as can be told from here."""
    host = settings.host
    if host in ("0.0.0.0", "::"):  # noqa: S104 - another machine needs one of our addresses
        try:
            host = socket.gethostbyname(socket.gethostname())
        except OSError:
            host = "127.0.0.1"
    scheme = "http" if settings.tls_certificate is None else "https"
    return f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}"


class Server(uvicorn.Server):
    """Serves the application on a socket that already listens; ends streams when asked to stop."""

    def __init__(
        self,
        app: FastAPI,
        listening: socket.socket,
        started: "Callable[[Server], None] | None",
        first_token: Path | None = None,
    ) -> None:
        self.first_token = first_token
        """Where an operator's token was written to, when this was the first start."""
        # The lifespan is entered by serve(), whose caller then sees why a start failed.
        settings: Settings = app.state.edge.settings
        self.shares: Shares = app.state.shares
        self.sockets: Sockets[asyncio.Protocol] = Sockets(
            settings.max_connections, lru_cache(4096)(partial(is_shared_host, settings))
        )
        super().__init__(
            uvicorn.Config(
                app,
                http=patient_http(settings, self.sockets),
                lifespan="off",
                log_config=None,
                access_log=False,
                timeout_graceful_shutdown=GRACE_S,
                server_header=False,
                proxy_headers=False,  # see AddressMiddleware
                ssl_certfile=settings.tls_certificate,
                ssl_keyfile=settings.tls_key,
                # Viewers have nothing to say.
                ws_max_size=MAX_VIEWER_MESSAGE_BYTES,
                # Messages are small; to deflate each of them for each viewer costs more than all else of the live view.
                ws_per_message_deflate=False,
            )
        )
        self._app = app
        self._listening = listening
        self._started = started

    @property
    def url(self) -> str:
        """Where the service answers."""
        host, port = self._listening.getsockname()[:2]
        if host in ("0.0.0.0", "::"):  # noqa: S104 - only shown
            host = "localhost"
        scheme = "https" if self.config.is_ssl else "http"
        return f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}"

    def stop(self) -> None:
        """Answer what is open, close every stream and end."""
        self._begin_to_end()
        self.should_exit = True

    def _begin_to_end(self) -> None:
        self._app.state.edge.stopping.set()
        self._app.state.edge.service.begin_no_more()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to answer."""
        await super().startup(sockets)
        if self._started is not None:
            self._started(self)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop the vehicles, which may poll until then, and answer what is open."""
        await self._app.state.edge.service.stop_vehicles()
        await super().shutdown(sockets)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End on the first signal; a second Ctrl-C waits for no open request."""
        self._begin_to_end()
        super().handle_exit(sig, frame)

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to :func:`serve`, which catches them for longer."""
        yield


def listen(settings: Settings) -> socket.socket:
    """Return a socket that is bound as set up. Raises StartupError when the address is taken or not ours."""
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    # asyncio switches Nagle's algorithm off, 40 ms per answer, only for sockets that name their protocol.
    bound = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((settings.host, settings.port))
    except OSError as error:
        bound.close()
        raise StartupError(
            f"cannot listen on {settings.host}:{settings.port}: {error.strerror}; choose another with --port or --host"
        ) from None
    return bound


async def serve(
    settings: Settings, *, started: Callable[[Server], None] | None = None, with_first_token: bool = False
) -> None:
    """Serve until a signal or :meth:`Server.stop`; ``started`` is called once requests are answered.

    A signal while it starts cancels the start. Either way every vehicle is stopped before this returns.

    ``with_first_token`` makes an operator's token where there never was one, beside the database or here.

    Raises
    ------
    StartupError, DatabaseNotReadyError
        When the service cannot start as it is set up.
    """
    if wrong := unusable_certificate(settings):
        raise StartupError(wrong)
    if settings.tls_certificate and (when := when_not_valid(settings.tls_certificate, clock.now())):
        log.warning("clients refuse the certificate, which is not valid now", tls_certificate=when)
    keep_memory_together()
    sys.setswitchinterval(SWITCH_S)
    allow_descriptors(settings.max_connections)
    listening = listen(settings)
    supervisor = SystemdNotifier.of(os.environ)

    def written() -> bool:
        edge: EdgeState | None = getattr(app.state, "edge", None)
        return edge is not None and edge.service.all_written

    def begun(server: Server) -> None:
        supervisor.tell(READY="1", STATUS=f"answers at {server.url}")
        if started is not None:
            started(server)

    try:
        app = create_app(settings, port=listening.getsockname()[1])
        signals = EndSignals(written)
        # Signals from before the first mission is taken up to the very end.
        with signals.caught():
            async with supervisor.watching(), app.router.lifespan_context(app):
                first_token = await _first_token(app.state.edge) if with_first_token else None
                with settled():
                    async with supervisor.told_of(app.state.edge.stopping):
                        server = Server(app, listening, begun, first_token)
                        signals.ended_by(lambda number: server.handle_exit(number, None))
                        await server.serve(sockets=[listening])
    finally:
        listening.close()


async def _first_token(edge: EdgeState) -> Path | None:
    try:
        written = await edge.tokens.first_start(folder_of(edge.settings.database_url))
    except OSError as error:
        log.warning("no operator token could be written", reason=error.strerror)
        return None
    if written is not None:
        made = Command("bathyfleet", "", "first start", "token create", f"first start, {Role.OPERATOR}", "done")
        await edge.audit.write(made)
    return written
