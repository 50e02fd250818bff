"""Who is told of alarms in tests: real servers of HTTP, mail and MQTT; and a dispatcher to tell them."""

import http.server
import json
import shutil
import ssl
import subprocess
import threading
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from email.message import EmailMessage
from pathlib import Path
from typing import Any

import pytest
from aiosmtpd.controller import Controller
from aiosmtpd.handlers import Message
from aiosmtpd.smtp import AuthResult, LoginPassword

from app.missions.alarm_kinds import AlarmKind
from app.missions.alarm_settings import AlarmSettings
from app.missions.alarms.dispatcher import AlarmDispatcher
from app.missions.alarms.raised import make_alarm
from app.missions.views.alarms import AlarmReport
from app.storage.database import Database
from app.storage.models import AlarmRow, ProcessRow
from app.storage.queries import alarms as alarm_queries
from tests.support.ports import free_ports
from tests.support.storage import rows
from tests.support.waiting import until

SECRET = "whsec_C2FVsBQIhrscChlQIMV+b5sSYspob7oD"  # noqa: S105 - the example of Standard Webhooks
PASSWORD = "over the net only by TLS"  # noqa: S105 - the test's own
BEGAN = datetime(2026, 6, 1, 3, 0, tzinfo=UTC)


@dataclass
class Clock:
    """A wall clock that is moved by hand."""

    at: datetime = BEGAN

    def __call__(self) -> datetime:
        return self.at

    def advance(self, seconds: float) -> None:
        self.at += timedelta(seconds=seconds)


@dataclass
class Hook:
    """A program that is told by HTTP. ``statuses``: what it answers first; then 204."""

    statuses: list[int] = field(default_factory=list)
    requests: list[tuple[Mapping[str, str], bytes]] = field(default_factory=list)
    port: int = 0
    release: threading.Event = field(default_factory=threading.Event)
    """While it is not set nothing is answered."""

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/alarms"

    @property
    def ids(self) -> list[str]:
        return [headers["webhook-id"] for headers, _ in self.requests]

    @property
    def said(self) -> list[dict[str, Any]]:
        return [json.loads(body) for _, body in self.requests]


@contextmanager
def hook(*statuses: int) -> Iterator[Hook]:
    """Yield a server that answers with these statuses first."""
    state = Hook(list(statuses))
    state.release.set()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            state.requests.append(({key.lower(): value for key, value in self.headers.items()}, body))
            state.release.wait()
            status = state.statuses.pop(0) if state.statuses else 204
            self.send_response(status)
            if status in (301, 302, 307, 308):
                self.send_header("location", state.url + "/elsewhere")
            self.send_header("content-length", "0")
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        state.port = server.server_port
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield state
        finally:
            state.release.set()
            server.shutdown()
            thread.join()


class Mailbox(Message):
    """Keeps what the mail server took. ``refused``: addresses that it does not know."""

    def __init__(self) -> None:
        super().__init__(EmailMessage)
        self.mails: list[EmailMessage] = []
        self.encrypted: list[bool] = []
        self.refused: set[str] = set()

    async def handle_RCPT(  # noqa: N802 - the library's name
        self, _server: Any, _session: Any, envelope: Any, address: str, _options: list[str]
    ) -> str:
        if address in self.refused:
            return "550 5.1.1 no such mailbox"
        envelope.rcpt_tos.append(address)
        return "250 OK"

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:  # noqa: N802 - the library's name
        self.encrypted.append(session.ssl is not None)
        return str(await super().handle_DATA(server, session, envelope))

    def handle_message(self, message: Any) -> None:
        self.mails.append(message)


@contextmanager
def mail_server(certificate: Path) -> Iterator[tuple[Mailbox, int]]:
    """Yield a mail server that takes e-mails only after STARTTLS and a login, and its port."""
    box = Mailbox()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate)

    def log_in(_server: Any, _session: Any, _envelope: Any, _mechanism: str, data: Any) -> AuthResult:
        good = isinstance(data, LoginPassword) and (data.login, data.password) == (b"ship", PASSWORD.encode())
        return AuthResult(success=good, handled=good)

    [port] = free_ports(1)
    server = Controller(
        box,
        hostname="127.0.0.1",
        port=port,
        tls_context=context,
        require_starttls=True,
        auth_required=True,
        authenticator=log_in,
        server_hostname="mail.test",
    )
    server.start()
    try:
        yield box, port
    finally:
        server.stop()


@asynccontextmanager
async def broker() -> AsyncIterator[int]:
    """Yield the port of an MQTT broker."""
    from amqtt.broker import Broker

    [port] = free_ports(1)
    server = Broker(
        {
            "listeners": {"default": {"type": "tcp", "bind": f"127.0.0.1:{port}"}},
            "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}},
        }
    )
    await server.start()
    try:
        yield port
    finally:
        await server.shutdown()


def make_certificate(folder: Path) -> Path:
    """Return a file with a certificate for 127.0.0.1 and its key."""
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("openssl is not installed: no certificate can be made")
    file, key = folder / "mail.pem", folder / "key.pem"
    new = [openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2"]
    named = ["-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(file)]
    subprocess.run(new + named, check=True, capture_output=True)
    file.write_bytes(key.read_bytes() + file.read_bytes())
    return file


def told_by(*hooks: Hook, **changes: Any) -> AlarmSettings:
    """Return settings with webhooks named a, b and so on; without ``routes`` the first is told of everything."""
    webhooks = [{"name": name, "url": hook.url, "secret": SECRET} for name, hook in zip("abc", hooks, strict=False)]
    return AlarmSettings.model_validate({"webhooks": webhooks, "routes": [{"to": ["a"]}]} | changes)


@dataclass
class Watch:
    """A dispatcher that looks when it is told to, on a clock that is moved by hand."""

    dispatcher: AlarmDispatcher
    database: Database
    clock: Clock
    number: int

    async def raise_alarm(self, kind: AlarmKind = AlarmKind.VEHICLE_LOST, vehicle: str = "a") -> AlarmRow:
        """Store an alarm as a mission's journal does."""
        row = make_alarm(kind, "m1", f"{vehicle} is lost: silent", self.clock(), vehicle=vehicle)
        async with self.database.writing() as session:
            session.add(row)
        self.dispatcher.stored(row)
        return row

    async def end(self, row: AlarmRow) -> None:
        """Store that an alarm's cause is over, as a mission's journal does."""
        async with self.database.writing() as session:
            await alarm_queries.end(session, "m1", [row.kind], row.vehicle, self.clock())

    async def look(self) -> None:
        """Look, wait for what was sent, and write down what came of it."""
        await self.dispatcher.look()
        await self.sent()
        await self.dispatcher.look()

    async def sent(self) -> None:
        """Wait until nothing is being sent."""
        await until(lambda: not self.dispatcher.sending, "everything was sent")

    async def report(self, row: AlarmRow) -> AlarmReport:
        return await self.dispatcher.alarm(row.id)


async def open_watch(database: Database, settings: AlarmSettings, clock: Clock) -> Watch:
    """Return a dispatcher of one more process on a database with mission m1."""
    async with database.writing() as session:
        process = ProcessRow(url="http://127.0.0.1:1", secret="e" * 64, certificate=None, began_at=clock())
        session.add(process)
        await session.flush()
        number = process.id
    return Watch(AlarmDispatcher(settings, database, lambda: number, now=clock), database, clock, number)


async def with_mission(database: Database) -> None:
    """Store mission m1."""
    async with database.writing() as session:
        session.add(rows.mission())


async def end_of_process(watch: Watch) -> None:
    """End a dispatcher and bury its process, as a process that ends or is killed is buried."""
    from app.storage.processes import processes

    await watch.dispatcher.close()
    async with watch.database.writing() as session:
        await processes.bury(session, [watch.number])
