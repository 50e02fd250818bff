"""Alarms as they are made, stored and shown."""

import uuid
from datetime import datetime
from typing import Protocol

from app.missions.alarm_kinds import ALARMS, AlarmKind, AlarmSeverity
from app.missions.views.alarms import AlarmState, AlarmView
from app.storage.models import AlarmRow


class AlarmWatch(Protocol):
    """Hears of a mission's alarms as they come."""

    def noted(self, row: AlarmRow) -> None:
        """An alarm is raised that is not stored yet: ``row`` is what will be."""

    def stored(self, row: AlarmRow) -> None:
        """An alarm was stored."""


def make_alarm(
    kind: AlarmKind, mission_id: str | None, message: str, at: datetime, *, vehicle: str | None = None
) -> AlarmRow:
    """Return a new alarm, which nobody has been told of."""
    return AlarmRow(
        id=str(uuid.uuid4()),
        mission_id=mission_id,
        event_id=None,
        kind=kind,
        severity=ALARMS[kind].severity,
        vehicle=vehicle,
        message=message,
        raised_at=at,
        ended_at=None,
        acknowledged_at=None,
        acknowledged_by=None,
        told_after_s=None,
        next_at=at,
    )


def copy_of(row: AlarmRow) -> AlarmRow:
    """Return the same alarm for another transaction."""
    return AlarmRow(**{column.key: getattr(row, column.key) for column in AlarmRow.__table__.columns})


def alarm_view(row: AlarmRow) -> AlarmView:
    """Return an alarm as it is shown."""
    return AlarmView(
        id=row.id,
        mission_id=row.mission_id,
        kind=AlarmKind(row.kind),
        severity=AlarmSeverity(row.severity),
        vehicle=row.vehicle,
        message=row.message,
        raised_at=row.raised_at,
        ended_at=row.ended_at,
        state=AlarmState.OPEN if row.acknowledged_at is None else AlarmState.ACKNOWLEDGED,
        acknowledged_at=row.acknowledged_at,
        acknowledged_by=row.acknowledged_by,
    )


class AlarmBoard(Protocol):
    """Where people see a mission's alarms."""

    mission_id: str

    @property
    def open(self) -> list[AlarmView]:
        """Those that nobody has acknowledged."""

    def show(self, alarm: AlarmView) -> None:
        """Show an alarm as it is now."""
