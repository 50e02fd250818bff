"""The audit log: every command is written down before it is answered, refused ones as well."""

import json
from collections.abc import Sequence
from datetime import UTC, date, datetime
from typing import Annotated, Any

import structlog
from fastapi import APIRouter, Query
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field
from sqlalchemy.exc import SQLAlchemyError
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.auth import Admin
from app.api.limits import Buckets, host_of
from app.api.problems import problems
from app.api.schemas import API
from app.api.state import State
from app.storage import audit
from app.storage.database import Database
from app.storage.models import AuditRow

DATA = frozenset({"postMeasurements", "postScans"})
"""What vehicles send all the time is data, kept with its verdict; only what is refused of it is written down."""
QUESTIONS = frozenset({"forecastMission", "forecastDescription"})
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
        """Return commands, newest first; see :func:`app.storage.audit.newest`."""
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


class AuditEntry(BaseModel):
    """A command and what came of it."""

    model_config = ConfigDict(from_attributes=True)

    id: int
    time: AwareDatetime
    actor: str = Field(description="The token's name; empty where nobody was recognized")
    role: str
    origin: str = Field(description="The address that it came from, or `command line`", examples=["192.0.2.7"])
    action: str = Field(description="The operation's name in this document, or a command's", examples=["startMission"])
    target: str = Field(description="The path, or what the command was given")
    mission_id: str | None
    result: str = Field(description="done, refused or failed", examples=["done"])
    status: int | None = Field(description="The HTTP status of the answer")
    detail: str = Field(description="Why it was refused")
    request_id: str


router = APIRouter(prefix=API, tags=["audit"], responses=problems("unauthenticated", "forbidden"))


@router.get(
    "/audit",
    operation_id="listAudit",
    summary="See who commanded what",
    responses=problems("invalid-request"),
)
async def list_audit(
    state: State,
    admin: Admin,
    before: Annotated[int | None, Query(ge=1, lt=2**62, description="Only older entries than that of this id")] = None,
    days: Annotated[float | None, Query(gt=0, le=36_500, description="Only entries of the last so many days")] = None,
    actor: Annotated[
        str | None, Query(max_length=120, pattern=r"^[^\x00]+$", description="Only of the token of this name")
    ] = None,
    mission: Annotated[
        str | None, Query(max_length=64, pattern=r"^[A-Za-z0-9_-]+$", description="Only to the mission of this id")
    ] = None,
    limit: Annotated[int, Query(ge=1, le=1000, description="Most entries in the answer")] = 100,
) -> list[AuditEntry]:
    """Return every command that changed something or was refused, newest first. Only for admins."""
    rows = await state.audit.newest(limit=limit, before=before, days=days, actor=actor, mission_id=mission)
    return [AuditEntry.model_validate(row) for row in rows]
