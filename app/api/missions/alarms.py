"""Alarms of all missions: what is open, who took what, and who was told."""

from typing import Annotated

from fastapi import APIRouter, Path, Query
from pydantic import BaseModel, ConfigDict, Field

from app.api.access.auth import Operator, Reader
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import problems
from app.api.schemas import API
from app.api.state import Service
from app.missions.alarm_kinds import AlarmSeverity
from app.missions.views.alarms import AlarmReport, AlarmState

router = APIRouter(
    prefix=f"{API}/alarms",
    tags=["alarms"],
    responses=problems("unauthenticated", "forbidden", "invalid-request"),
    route_class=JsonRoute,
)

AlarmId = Annotated[str, Path(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_-]+$", description="The alarm's id")]


class AlarmTrial(BaseModel):
    """Whom to try to reach."""

    model_config = ConfigDict(extra="forbid")

    severity: AlarmSeverity = Field(default=AlarmSeverity.MINOR, description="As grave as this: routes go by it")
    to: str | None = Field(
        default=None, max_length=64, description="Only this recipient of the settings; null: whom the routes say"
    )


@router.get("", operation_id="listAlarms", summary="List alarms")
async def list_alarms(
    service: Service,
    reader: Reader,
    state: Annotated[AlarmState | None, Query(description="Only these; left out: all")] = None,
    mission: Annotated[
        str | None, Query(max_length=64, pattern=r"^[^\x00]*$", description="Only those of the mission with this id")
    ] = None,
    limit: Annotated[int, Query(ge=1, le=1000, description="Most alarms in the answer")] = 200,
) -> list[AlarmReport]:
    """Return alarms of all missions, newest first, each with who was told of it and what came of that."""
    return await service.alarms.alarms(state, mission, limit)


@router.post(
    "/test",
    operation_id="testAlarm",
    summary="Try who is told",
    status_code=201,
    responses=problems("malformed-body", "body-too-large", "unsupported-media-type", "database-unavailable"),
)
async def try_alarm(service: Service, operator: Operator, body: AlarmTrial | None = None) -> AlarmReport:
    """Raise a test alarm, which goes out as any other. What comes of it is in its deliveries: ask for it again."""
    trial = body or AlarmTrial()
    return await service.alarms.test(operator.name, trial.severity, trial.to)


@router.get("/{alarm_id}", operation_id="getAlarm", summary="See an alarm", responses=problems("alarm-not-found"))
async def get_alarm(service: Service, reader: Reader, alarm_id: AlarmId) -> AlarmReport:
    """Return an alarm with who was told of it and what came of that."""
    return await service.alarms.alarm(alarm_id)


@router.post(
    "/{alarm_id}/acknowledge",
    operation_id="acknowledgeAlarm",
    summary="Take an alarm",
    responses=problems("alarm-not-found", "database-unavailable"),
)
async def acknowledge_alarm(service: Service, operator: Operator, alarm_id: AlarmId) -> AlarmReport:
    """Note that you have taken the alarm: nobody else is told any more. Who took it first stays."""
    return await service.alarms.acknowledge(alarm_id, operator.name)
