"""Alarms and what was told of them, as they are answered."""

from datetime import datetime
from enum import StrEnum

from pydantic import Field, computed_field

from app.missions.alarm_kinds import ALARMS, AlarmKind, AlarmSeverity
from app.missions.views.base import View


class AlarmState(StrEnum):
    """Whether somebody has taken an alarm."""

    OPEN = "open"
    ACKNOWLEDGED = "acknowledged"


class Notice(StrEnum):
    """Why somebody is told of an alarm."""

    RAISED = "raised"
    ESCALATED = "escalated"
    """Nobody acknowledged it in time."""
    ACKNOWLEDGED = "acknowledged"
    ENDED = "ended"
    """What raised it is over."""


class DeliveryState(StrEnum):
    """How far the telling has come."""

    WAITING = "waiting"
    DELIVERED = "delivered"
    FAILED = "failed"
    """It was tried for as long as the settings say."""
    SUPERSEDED = "superseded"
    """The alarm was acknowledged, or over, before it could be told; or what it follows was given up."""


class AlarmView(View):
    """An alarm: who has it, or that nobody has."""

    id: str
    mission_id: str | None = Field(description="null: it concerns no mission")
    kind: AlarmKind
    severity: AlarmSeverity
    vehicle: str | None
    message: str
    raised_at: datetime
    ended_at: datetime | None = Field(
        description="When what raised it was over; it stays open until acknowledged. null: it goes on, or cannot end"
    )
    state: AlarmState
    acknowledged_at: datetime | None
    acknowledged_by: str | None = Field(description="The name of the token, or of the user, that acknowledged it")

    @computed_field  # type: ignore[prop-decorator]
    @property
    def action(self) -> str:
        """What whoever is on watch does about it."""
        return ALARMS[self.kind].action


class DeliveryView(View):
    """What one recipient is told, and what came of it."""

    id: str = Field(description="What the recipient sees as the message's id; the same at every attempt")
    recipient: str = Field(description="The recipient's name in the settings")
    notice: Notice
    state: DeliveryState
    attempts: int
    created_at: datetime
    next_try_at: datetime | None = Field(description="null: it is not tried again")
    done_at: datetime | None
    error: str = Field(description="Why the last attempt failed; empty when none did")


class AlarmReport(AlarmView):
    """An alarm with everything that was told of it."""

    deliveries: list[DeliveryView]
