"""The audit log: every command is written down before it is answered, refused ones as well."""

import json
from collections.abc import Sequence
from datetime import UTC, date, datetime
from typing import Any

import structlog
from sqlalchemy.exc import SQLAlchemyError
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.accounts.rates import Buckets, host_of
from app.storage.database import Database
from app.storage.models import AuditRow
from app.storage.queries import audit

DATA = frozenset({"postMeasurements", "postScans"})
"""What vehicles send all the time is data, kept with its verdict; only what is refused of it is written down."""
QUESTIONS = frozenset({"forecastMission", "forecastDescription", "previewPlan"})
"""Posted, because they are long, but they change nothing."""
STRANGERS_PER_MINUTE = 60
MAX_DETAIL_BYTES = 65_536

log = structlog.get_logger(__name__)


class AuditLog:
    """Writes commands down, and once a day removes those older than ``days``.

    A command that was carried out is answered even when it cannot be written down; the service's log says so.
    """

    def __init__(self, database: Database, days: float) -> None:
        self._database = database
        self._days = days
        self._tidied: date | None = None
        # Nobody who has no token may fill the disk with refusals.
        self._strangers = Buckets(STRANGERS_PER_MINUTE / 60, STRANGERS_PER_MINUTE)
        self._unwritten = 0

    async def write(self, command: audit.Command) -> None:
        """Write down a command; of strangers' refused ones only so many a minute, then their number."""
        if not command.actor:
            if self._strangers.take("") > 0.0:
                self._unwritten += 1
                return
            if self._unwritten:
                more = f"{self._unwritten} more refusals before it were not written down"
                command = audit.Command(**(vars(command) | {"detail": f"{command.detail} ({more})"}))
                self._unwritten = 0
        try:
            async with self._database.writing() as session:
                audit.add(session, command)
                if self._tidied != (today := datetime.now(UTC).date()):
                    self._tidied = today
                    await audit.forget(session, self._days)
        except (OSError, SQLAlchemyError):
            log.exception("the audit log cannot be written", **vars(command))

    async def newest(self, **choice: Any) -> Sequence[AuditRow]:
        """Return commands, newest first; see :func:`app.storage.queries.audit.newest`."""
        async with self._database.reading() as session:
            return await audit.newest(session, **choice)


class AuditMiddleware:
    """Writes down every request that may change something, with its answer."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request; the end of its answer waits until it is written down."""
        if scope["type"] != "http" or scope["method"] in ("GET", "HEAD", "OPTIONS"):
            await self.app(scope, receive, send)
            return
        status = 0
        answer = bytearray()
        written = False

        async def send_when_written(message: Message) -> None:
            nonlocal status, written
            if message["type"] == "http.response.start":
                status = message["status"]
            elif message["type"] == "http.response.body":
                if status >= 400 and len(answer) < MAX_DETAIL_BYTES:
                    answer.extend(message.get("body", b""))
                if not message.get("more_body", False):
                    written = True
                    await self._write(scope, status, bytes(answer))
            await send(message)

        try:
            await self.app(scope, receive, send_when_written)
        finally:
            if not written:
                # It broke, or the client did not wait for the end.
                await self._write(scope, status or 500, b"")

    async def _write(self, scope: Scope, status: int, answer: bytes) -> None:
        action = getattr(scope.get("route"), "operation_id", None) or scope["method"]
        if scope.get("state", {}).get("sent_on", False):
            return  # the process that carried it out wrote it down
        if action in QUESTIONS or (action in DATA and status not in (401, 403)):
            return
        principal = scope.get("state", {}).get("principal")
        await scope["app"].state.edge.audit.write(
            audit.Command(
                actor=principal.name if principal else "",
                role=principal.role.value if principal else "",
                origin=host_of(scope),
                action=action,
                target=scope["path"],
                mission_id=scope.get("path_params", {}).get("mission_id"),
                result="done" if status < 400 else "refused" if status < 500 else "failed",
                status=status,
                detail=_detail(answer),
                request_id=scope.get("state", {}).get("request_id", ""),
            )
        )


def _detail(answer: bytes) -> str:
    try:
        return str(json.loads(answer)["detail"])
    except (ValueError, KeyError, TypeError):
        return ""
