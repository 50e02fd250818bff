"""The application: every part put together, opened at the start and closed at the end."""

import asyncio
import signal
import socket
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from types import FrameType

import structlog
import uvicorn
from fastapi import FastAPI
from fastapi_offline import FastAPIOffline
from starlette.middleware.cors import CORSMiddleware

from app import __version__
from app.api import (
    corrections,
    fleet,
    forecasts,
    imports,
    logs,
    maps,
    measurements,
    missions,
    openapi,
    problems,
    searches,
    soundings,
    streams,
    targets,
)
from app.api.auth import console_log_in
from app.api.health import health_router
from app.api.middleware import BodyMiddleware, RequestMiddleware
from app.api.schemas import API
from app.api.state import EdgeState
from app.api.tokens import TokenStore
from app.dashboard.serve import mount_dashboard
from app.memory import keep_memory_together
from app.missions.service import MissionService
from app.settings import Settings, StartupError, is_loopback, load_settings
from app.storage.database import Database
from app.storage.prepare import prepare_database

GRACE_S = 5
"""Seconds that open requests get to end when the process is asked to."""

log = structlog.get_logger(__name__)


def create_app(settings: Settings | None = None) -> FastAPI:
    """Return the application. Without ``settings`` they are read from the environment and ``bathyfleet.toml``."""
    settings = settings or load_settings()
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
            service = MissionService(
                settings.service(),
                database,
                lambda password, host: console_log_in(tokens, password, host, insecure=settings.insecure),
            )
            app.state.edge = EdgeState(settings, service, tokens)
            await service.startup()
            try:
                yield
            finally:
                app.state.edge.stopping.set()
                await service.shutdown()
                tokens.close()
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
    for router in (
        missions.router,
        forecasts.router,
        measurements.router,
        corrections.router,
        imports.router,
        maps.router,
        soundings.router,
        targets.router,
        searches.router,
        streams.router,
        fleet.router,
        health_router(API),
    ):
        app.include_router(router)
    app.include_router(health_router(""), include_in_schema=False)
    mount_dashboard(app, charts=settings.charts)
    problems.install(app)
    openapi.install(app)
    if settings.allowed_origins:
        app.add_middleware(
            CORSMiddleware, allow_origins=settings.allowed_origins, allow_methods=["*"], allow_headers=["*"]
        )
    app.add_middleware(BodyMiddleware, max_bytes=settings.max_body_bytes, max_file_bytes=settings.max_import_bytes)
    app.add_middleware(RequestMiddleware)
    return app


class Server(uvicorn.Server):
    """Serves the application on a socket that already listens; ends streams when asked to stop."""

    def __init__(self, app: FastAPI, listening: socket.socket, started: "Callable[[Server], None] | None") -> None:
        # The lifespan is entered by serve(), whose caller then sees why a start failed.
        super().__init__(
            uvicorn.Config(
                app,
                lifespan="off",
                log_config=None,
                access_log=False,
                timeout_graceful_shutdown=GRACE_S,
                server_header=False,
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
        return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"

    def stop(self) -> None:
        """Answer what is open, close every stream and end."""
        self._app.state.edge.stopping.set()
        self.should_exit = True

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to answer."""
        await super().startup(sockets)
        if self._started is not None:
            self._started(self)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End on the first signal, at once on a second."""
        self._app.state.edge.stopping.set()
        super().handle_exit(sig, frame)

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Handle signals while serving; not raised again, so that vehicles are stopped after the last request."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        loop = asyncio.get_running_loop()
        signals = (signal.SIGINT, signal.SIGTERM)
        for number in signals:
            loop.add_signal_handler(number, self.handle_exit, number, None)
        try:
            yield
        finally:
            for number in signals:
                loop.remove_signal_handler(number)


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


async def serve(settings: Settings, *, started: Callable[[Server], None] | None = None) -> None:
    """Serve until a signal or :meth:`Server.stop`; ``started`` is called once requests are answered.

    Raises
    ------
    StartupError, DatabaseNotReadyError
        When the service cannot start as it is set up.
    """
    keep_memory_together()
    listening = listen(settings)
    try:
        app = create_app(settings)
        async with app.router.lifespan_context(app):
            await Server(app, listening, started).serve(sockets=[listening])
    finally:
        listening.close()
