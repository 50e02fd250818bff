"""Alarms, and what somebody is told of them."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index, String, Text
from sqlalchemy.orm import Mapped, mapped_column

from app.storage.models.base import Base, BigId


class AlarmRow(Base):
    """An alarm: what somebody on watch has to take. It is stored together with its line in the mission's log."""

    __tablename__ = "alarms"
    __table_args__ = (
        Index("ix_alarms_mission", "mission_id", "raised_at"),
        Index("ix_alarms_acknowledged", "acknowledged_at", "raised_at"),
        Index("ix_alarms_next", "next_at"),
    )

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    mission_id: Mapped[str | None] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    event_id: Mapped[int | None] = mapped_column(BigId, ForeignKey("events.id", ondelete="CASCADE"), index=True)
    kind: Mapped[str] = mapped_column(String(32))
    severity: Mapped[str] = mapped_column(String(16))
    vehicle: Mapped[str | None] = mapped_column(String(64))
    message: Mapped[str] = mapped_column(Text)
    raised_at: Mapped[datetime]
    ended_at: Mapped[datetime | None]
    """When its cause was over; it stays open until somebody acknowledges it."""
    acknowledged_at: Mapped[datetime | None]
    acknowledged_by: Mapped[str | None] = mapped_column(String(120))
    told_after_s: Mapped[float | None]
    """Who is to be told when nobody acknowledges for so long was told; None: nobody yet."""
    next_at: Mapped[datetime | None]
    """When somebody is to be told next; None: nobody is."""


class AlarmDeliveryRow(Base):
    """What somebody is told of an alarm. Its id follows from alarm, recipient and notice: nobody makes it twice."""

    __tablename__ = "alarm_deliveries"
    __table_args__ = (Index("ix_alarm_deliveries_due", "state", "next_try_at"),)

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    alarm_id: Mapped[str] = mapped_column(ForeignKey("alarms.id", ondelete="CASCADE"), index=True)
    recipient: Mapped[str] = mapped_column(String(64))
    notice: Mapped[str] = mapped_column(String(16))
    """raised, escalated, acknowledged or ended."""
    state: Mapped[str] = mapped_column(String(16))
    """waiting, delivered, failed or superseded."""
    attempts: Mapped[int]
    created_at: Mapped[datetime]
    next_try_at: Mapped[datetime]
    done_at: Mapped[datetime | None]
    error: Mapped[str] = mapped_column(Text, default="")
    """Why the last attempt failed."""
    process_id: Mapped[int | None] = mapped_column(ForeignKey("processes.id", ondelete="SET NULL"), index=True)
    """The process that delivers it just now; it ends with the process."""
