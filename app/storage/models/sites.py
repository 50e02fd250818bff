"""Places that are surveyed again and again."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, LargeBinary, String
from sqlalchemy.orm import Mapped, mapped_column

from app.storage.models.base import Base, BigId


class SiteRow(Base):
    """A place that is surveyed again and again: its area and how its surveys are taken together."""

    __tablename__ = "sites"

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    name: Mapped[str] = mapped_column(String(120))
    spec: Mapped[dict[str, Any]]
    created_at: Mapped[datetime]
    updated_at: Mapped[datetime]


class SiteMissionRow(Base):
    """Which site a mission belongs to."""

    __tablename__ = "site_missions"

    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True)
    site_id: Mapped[str] = mapped_column(ForeignKey("sites.id"), index=True)


class SiteSurveyRow(Base):
    """What a mission that ended found of its site, of its own soundings alone.

    Without a foreign key to missions: what was found stays when a mission is removed to make room. It is dropped in
    the transaction that changes soundings which it was made of, and is outdated when there is a sounding after
    ``last_sounding``, an import in the log after ``last_import`` or a block of pings after ``last_block``.
    ``content`` holds the survey's layers (``missions/maps/survey_codec.py``).
    """

    __tablename__ = "site_surveys"

    mission_id: Mapped[str] = mapped_column(String(36), primary_key=True)
    site_id: Mapped[str] = mapped_column(ForeignKey("sites.id"), index=True)
    mission_name: Mapped[str] = mapped_column(String(120))
    made_at: Mapped[datetime]
    first_time_s: Mapped[float]
    last_time_s: Mapped[float]
    last_sounding: Mapped[int] = mapped_column(BigId)
    last_import: Mapped[int] = mapped_column(BigId)
    last_block: Mapped[int] = mapped_column(BigId)
    summary: Mapped[dict[str, Any]]
    digest: Mapped[str] = mapped_column(String(64))
    """SHA-256 of the content."""
    content: Mapped[bytes] = mapped_column(LargeBinary)
