"""Pings of swath sonars, as blocks and as files."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index, LargeBinary, String, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.storage.models.base import Base, BigId


class PingBlockRow(Base):
    """Pings of a vehicle that were judged together, in the order in which that was done, until a file holds them.

    ``times`` holds the pings' times as little-endian float64, ``content`` all of them (``missions/pings/codec.py``).
    """

    __tablename__ = "ping_blocks"
    __table_args__ = (
        Index("ix_ping_blocks_mission", "mission_id", "id"),
        Index("ix_ping_blocks_times", "mission_id", "vehicle", "last_time_s"),
        # The id of a block that was moved to a file must never be another one's.
        {"sqlite_autoincrement": True},
    )

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    step: Mapped[int]
    received_at: Mapped[datetime]
    source: Mapped[str] = mapped_column(String(64))
    first_time_s: Mapped[float]
    last_time_s: Mapped[float]
    pings: Mapped[int]
    beams: Mapped[int]
    """Of the accepted pings, those that detected something."""
    rejected: Mapped[int]
    """Pings that were refused; the content has them and why."""
    times: Mapped[bytes] = mapped_column(LargeBinary)
    content: Mapped[bytes] = mapped_column(LargeBinary)
    log: Mapped[int | None] = mapped_column(BigId)
    """The :class:`LogRow` of the log that brought them."""


class PingChunkRow(Base):
    """A file with what blocks of a vehicle's pings held, which are removed in the transaction that adds this row."""

    __tablename__ = "ping_chunks"
    __table_args__ = (
        UniqueConstraint("name", name="uq_ping_chunks_name"),
        Index("ix_ping_chunks_mission", "mission_id", "id"),
        Index("ix_ping_chunks_times", "mission_id", "vehicle", "last_time_s"),
    )

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    name: Mapped[str] = mapped_column(String(200))
    """Below the folder of all missions."""
    first_block: Mapped[int] = mapped_column(BigId)
    last_block: Mapped[int] = mapped_column(BigId)
    """It holds every block of the vehicle between the two."""
    first_time_s: Mapped[float]
    last_time_s: Mapped[float]
    pings: Mapped[int]
    beams: Mapped[int]
    rejected: Mapped[int]
    times: Mapped[bytes] = mapped_column(LargeBinary)
    digest: Mapped[str] = mapped_column(String(64))
    """SHA-256 of the file."""
    size: Mapped[int] = mapped_column(BigId)
    log: Mapped[int | None] = mapped_column(BigId)
    """The log that brought all of them; None: none brought any."""
