"""Processes that share the database, and who of them has which mission."""

from datetime import datetime

from sqlalchemy import ForeignKey, Integer, String, Text
from sqlalchemy.orm import Mapped, mapped_column

from app.storage.models.base import Base


class ProcessRow(Base):
    """A service process that shares this database. Its membership shows whether it still lives (``membership.py``)."""

    __tablename__ = "processes"

    id: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=True)
    url: Mapped[str] = mapped_column(String(200))
    """Where other processes reach it."""
    secret: Mapped[str] = mapped_column(String(64))
    """What they show to it; it ends with the process."""
    certificate: Mapped[str | None] = mapped_column(Text)
    """PEM of the certificate that it serves TLS with; None: plain HTTP, or one signed by a public authority."""
    began_at: Mapped[datetime]


class MissionOwnerRow(Base):
    """The one process that has a mission in memory; only it changes the mission."""

    __tablename__ = "mission_owners"

    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True)
    process_id: Mapped[int] = mapped_column(ForeignKey("processes.id", ondelete="CASCADE"), index=True)
    since: Mapped[datetime]


class ConsoleRow(Base):
    """An IMC id that a process on this database has led vehicles by: plans are called by it, also when it is gone."""

    __tablename__ = "consoles"

    imc_id: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=False)
