"""What maps are made of besides measurements, and what is kept of them: corrections, imports, references."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, LargeBinary, String, Text, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.storage.models.base import Base, BigId


class TideTableRow(Base):
    """A mission's table of high and low waters, as it was sent."""

    __tablename__ = "tide_tables"

    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True)
    name: Mapped[str] = mapped_column(String(200))
    text: Mapped[str] = mapped_column(Text)


class AdjustmentRow(Base):
    """By how much the positions of a mission's vehicles were off, and how that was found.

    ``content`` is JSON, compressed by zlib (``missions/soundings/adjustment.py``).
    """

    __tablename__ = "adjustments"

    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True)
    made_at: Mapped[datetime]
    actor: Mapped[str] = mapped_column(String(120))
    content: Mapped[bytes] = mapped_column(LargeBinary)


class ImportRow(Base):
    """Soundings or a map from elsewhere that a mission started with, all of them or none.

    ``soundings`` holds float64 rows of east, north, depth and standard deviation, compressed by zlib.
    """

    __tablename__ = "imports"
    __table_args__ = (UniqueConstraint("mission_id", "digest", name="uq_imports_digest"),)

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), index=True)
    digest: Mapped[str] = mapped_column(String(64))
    filename: Mapped[str] = mapped_column(String(200))
    created_at: Mapped[datetime]
    count: Mapped[int]
    summary: Mapped[dict[str, Any]]
    soundings: Mapped[bytes] = mapped_column(LargeBinary)


class ReferenceRow(Base):
    """The grid that a mission's map is compared with: float64 depths at the map's cells, compressed by zlib."""

    __tablename__ = "reference_grids"

    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True)
    filename: Mapped[str] = mapped_column(String(200))
    created_at: Mapped[datetime]
    rows: Mapped[int]
    cols: Mapped[int]
    summary: Mapped[dict[str, Any]]
    depths: Mapped[bytes] = mapped_column(LargeBinary)


class StoredMapRow(Base):
    """A mission's map as it was at a moment, so that the mission can be opened without all its soundings.

    It is dropped in the transaction that changes soundings which were there already. Those that came later have an id
    above ``last_sounding``, or there is an import in the log after ``last_import``.
    """

    __tablename__ = "stored_maps"

    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True)
    made_at: Mapped[datetime]
    step: Mapped[int]
    last_sounding: Mapped[int] = mapped_column(BigId)
    last_import: Mapped[int] = mapped_column(BigId)
    accepted: Mapped[int]
    rejected: Mapped[int]
    """Soundings that there were; the map may be of fewer."""
    soundings: Mapped[int]
    thorough: Mapped[bool]
    digest: Mapped[str] = mapped_column(String(64))
    content: Mapped[bytes] = mapped_column(LargeBinary)
