"""Showing the audit log to admins."""

from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field

from app.api.access.auth import Admin
from app.api.http.problems import problems
from app.api.schemas import API
from app.api.state import State


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
