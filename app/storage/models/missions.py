"""A mission: what was asked for, its vehicles, its steps, orders and its log."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, ForeignKeyConstraint, Index, LargeBinary, String, Text, true
from sqlalchemy.orm import Mapped, mapped_column, relationship

from app.storage.models.alarms import AlarmRow
from app.storage.models.base import Base, BigId


class MissionRow(Base):
    """A mission: what was asked for and where it is in its life."""

    __tablename__ = "missions"

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    name: Mapped[str] = mapped_column(String(120))
    state: Mapped[str] = mapped_column(String(16), index=True)
    reason: Mapped[str] = mapped_column(Text, default="")
    spec: Mapped[dict[str, Any]]
    created_at: Mapped[datetime]
    updated_at: Mapped[datetime]
    elapsed_s: Mapped[float] = mapped_column(default=0.0)
    ending: Mapped[dict[str, Any] | None]
    """What it becomes once all vehicles are home; None while it goes on."""
    summary: Mapped[dict[str, Any] | None]
    """How lists tell of one that ended and is in no memory; None of all others."""


class MissionVehicleRow(Base):
    """A vehicle's part in a mission. ``slot`` fixes its place in the depth stack; it is never reused."""

    __tablename__ = "mission_vehicles"

    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True)
    name: Mapped[str] = mapped_column(String(64), primary_key=True)
    slot: Mapped[int]
    spec: Mapped[dict[str, Any]]
    joined_at: Mapped[datetime]
    left_at: Mapped[datetime | None]
    flown: Mapped[dict[str, Any] | None]
    """What it has flown; None until it has set out."""
    withdrawal: Mapped[dict[str, Any] | None]
    """Why it does not survey any more; None while it does."""


class StepRow(Base):
    """A committed step: the decision, and the planner's memory after it."""

    __tablename__ = "steps"

    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True)
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    committed_at: Mapped[datetime]
    objective: Mapped[float | None]
    terms: Mapped[dict[str, Any]]
    figures: Mapped[dict[str, Any] | None]
    """How far the mission had come; None in steps of before that was kept."""
    soundings: Mapped[int]
    map_digest: Mapped[str] = mapped_column(String(64))
    memory: Mapped[bytes] = mapped_column(LargeBinary)
    targets: Mapped[bytes | None] = mapped_column(LargeBinary)
    """What was known of moving targets; None where the mission has none."""


class WaypointRow(Base):
    """Where a step sends a vehicle, and what became of it."""

    __tablename__ = "waypoints"
    __table_args__ = (
        ForeignKeyConstraint(["mission_id", "step"], ["steps.mission_id", "steps.number"], ondelete="CASCADE"),
    )

    mission_id: Mapped[str] = mapped_column(String(36), primary_key=True)
    step: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    vehicle: Mapped[str] = mapped_column(String(64), primary_key=True)
    lat_deg: Mapped[float]
    lon_deg: Mapped[float]
    east_m: Mapped[float]
    north_m: Mapped[float]
    depth_m: Mapped[float]
    status: Mapped[str] = mapped_column(String(16))
    reason: Mapped[str] = mapped_column(Text, default="")
    begun: Mapped[bool] = mapped_column(default=True, server_default=true())
    """False where it was taken back before its vehicle made for it."""
    changed_at: Mapped[datetime]


class VehicleOrderRow(Base):
    """What an operator ordered one vehicle to do in the middle of a mission, and what became of it."""

    __tablename__ = "vehicle_orders"
    __table_args__ = (Index("ix_vehicle_orders_mission", "mission_id", "id"),)

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    kind: Mapped[str] = mapped_column(String(16))
    state: Mapped[str] = mapped_column(String(16))
    way: Mapped[dict[str, Any]]
    """``corners``: where it leads along, a list of [longitude, latitude]."""
    asked_by: Mapped[str] = mapped_column(String(120))
    asked_at: Mapped[datetime]
    changed_at: Mapped[datetime]
    reason: Mapped[str] = mapped_column(Text, default="")


class BatchRow(Base):
    """The answer once given to an idempotency key."""

    __tablename__ = "batches"

    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True)
    key: Mapped[str] = mapped_column(String(200), primary_key=True)
    digest: Mapped[str] = mapped_column(String(64))
    answer: Mapped[dict[str, Any]]
    created_at: Mapped[datetime]


class EventRow(Base):
    """A line of a mission's log."""

    __tablename__ = "events"
    __table_args__ = (Index("ix_events_mission", "mission_id", "id"),)

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    time: Mapped[datetime]
    level: Mapped[str] = mapped_column(String(16))
    kind: Mapped[str] = mapped_column(String(32))
    message: Mapped[str] = mapped_column(Text)
    data: Mapped[dict[str, Any]]
    alarm: Mapped[AlarmRow | None] = relationship(lazy="raise", passive_deletes=True)
    """What it raised; only of rows that are being written."""
