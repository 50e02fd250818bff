"""What vehicles measured and where they were: soundings, ranges, scans, tracks, telemetry."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index, LargeBinary, String, Text, UniqueConstraint, false
from sqlalchemy.orm import Mapped, mapped_column

from app.storage.models.base import Base, BigId


class SoundingRow(Base):
    """A measurement of the sea floor: raw values as they came, the corrected depth beside them."""

    __tablename__ = "soundings"
    __table_args__ = (
        UniqueConstraint("mission_id", "vehicle", "time_s", "beam", name="uq_soundings_identity"),
        Index("ix_soundings_mission", "mission_id", "id"),
    )

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    time_s: Mapped[float]
    beam: Mapped[int]
    received_at: Mapped[datetime]
    step: Mapped[int]
    source: Mapped[str] = mapped_column(String(64))
    lat_deg: Mapped[float]
    lon_deg: Mapped[float]
    east_m: Mapped[float]
    north_m: Mapped[float]
    vehicle_depth_m: Mapped[float]
    range_m: Mapped[float]
    raw_depth_m: Mapped[float]
    depth_m: Mapped[float]
    sd_m: Mapped[float]
    position_sd_m: Mapped[float | None]
    level_m: Mapped[float | None]
    vehicle_lat_deg: Mapped[float | None]
    vehicle_lon_deg: Mapped[float | None]
    roll_deg: Mapped[float | None]
    pitch_deg: Mapped[float | None]
    heading_deg: Mapped[float | None]
    beam_azimuth_deg: Mapped[float | None]
    beam_off_nadir_deg: Mapped[float | None]
    verdict: Mapped[str] = mapped_column(String(16))
    reason: Mapped[str] = mapped_column(Text, default="")
    ruling: Mapped[str | None] = mapped_column(String(16))
    """An operator's decision, which overrules gate and map: restored or rejected."""
    log: Mapped[int | None] = mapped_column(BigId)
    """The :class:`LogRow` of the log that brought it; None: it was sent, or brought before logs were numbered."""


class LogRow(Base):
    """A vehicle's own log, of which something is stored; taken back and sent again it is another one.

    Rows of other tables have its number in their column ``log``.
    """

    __tablename__ = "logs"
    __table_args__ = (
        Index("ix_logs_mission", "mission_id", "digest"),
        # The number of a log that went with its mission must never be another one's.
        {"sqlite_autoincrement": True},
    )

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    digest: Mapped[str] = mapped_column(String(64))
    """SHA-256 of its content, unpacked."""
    altimeter: Mapped[str] = mapped_column(String(64))
    """The entity whose distances were taken as soundings."""
    file: Mapped[str] = mapped_column(String(200))
    created_at: Mapped[datetime]
    taken_back_at: Mapped[datetime | None]
    taken_back_by: Mapped[str | None] = mapped_column(String(200))


class BeamEditRow(Base):
    """What an operator once said of some beams of swath sonars: they are rejected, or restored.

    ``content`` holds which (``missions/soundings/beam_edits.py``).
    """

    __tablename__ = "beam_edits"
    __table_args__ = (
        Index("ix_beam_edits_mission", "mission_id", "id"),
        # The number of an edit that was taken back must never be another one's.
        {"sqlite_autoincrement": True},
    )

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    made_at: Mapped[datetime]
    actor: Mapped[str] = mapped_column(String(120))
    ruling: Mapped[str] = mapped_column(String(16))
    note: Mapped[str] = mapped_column(Text, default="")
    content: Mapped[bytes] = mapped_column(LargeBinary)


class TargetRangeRow(Base):
    """A range that a vehicle measured to a moving target, in the order in which they were judged."""

    __tablename__ = "target_ranges"
    __table_args__ = (
        UniqueConstraint("mission_id", "target", "vehicle", "time_s", name="uq_target_ranges_identity"),
        Index("ix_target_ranges_mission", "mission_id", "id"),
    )

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    target: Mapped[str] = mapped_column(String(64))
    vehicle: Mapped[str] = mapped_column(String(64))
    time_s: Mapped[float]
    at_s: Mapped[float]
    """When it was measured by the service's clock, as vehicles count seconds."""
    received_at: Mapped[datetime]
    step: Mapped[int]
    source: Mapped[str] = mapped_column(String(64))
    range_m: Mapped[float]
    lat_deg: Mapped[float]
    lon_deg: Mapped[float]
    depth_m: Mapped[float]
    position_sd_m: Mapped[float | None]
    verdict: Mapped[str] = mapped_column(String(16))
    reason: Mapped[str] = mapped_column(Text, default="")


class ScanRow(Base):
    """A look round by a vehicle of a search, in the order in which scans were judged.

    ``ranges`` holds little-endian float32 metres, compressed by zlib: infinite without an echo, NaN for a beam that is
    left out, negative in an accepted scan for one that ended so far away on a vehicle of the team.
    """

    __tablename__ = "scans"
    __table_args__ = (
        UniqueConstraint("mission_id", "vehicle", "time_s", name="uq_scans_identity"),
        Index("ix_scans_mission", "mission_id", "id"),
    )

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    time_s: Mapped[float]
    received_at: Mapped[datetime]
    step: Mapped[int]
    source: Mapped[str] = mapped_column(String(64))
    lat_deg: Mapped[float]
    lon_deg: Mapped[float]
    depth_m: Mapped[float]
    first_bearing_deg: Mapped[float]
    bearing_step_deg: Mapped[float]
    reach_m: Mapped[float]
    ranges: Mapped[bytes] = mapped_column(LargeBinary)
    verdict: Mapped[str] = mapped_column(String(16))
    reason: Mapped[str] = mapped_column(Text, default="")


class PositionRow(Base):
    """A point of a vehicle's track, thinned."""

    __tablename__ = "positions"
    __table_args__ = (Index("ix_positions_track", "mission_id", "vehicle", "id"),)

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    time_s: Mapped[float]
    """By the vehicle's clock, which may be reset."""
    lat_deg: Mapped[float]
    lon_deg: Mapped[float]
    depth_m: Mapped[float]
    imported: Mapped[bool] = mapped_column(default=False, server_default=false())
    """Whether a log brought it later; else ids are in the order in which positions arrived."""
    log: Mapped[int | None] = mapped_column(BigId)


class SoundSpeedRow(Base):
    """How fast sound was where a vehicle was, thinned; ``time_s`` by the vehicle's clock."""

    __tablename__ = "sound_speeds"
    __table_args__ = (Index("ix_sound_speeds_mission", "mission_id", "vehicle", "id"),)

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    source: Mapped[str] = mapped_column(String(64))
    """The probe."""
    time_s: Mapped[float]
    lat_deg: Mapped[float]
    lon_deg: Mapped[float]
    depth_m: Mapped[float]
    speed_mps: Mapped[float]


class TelemetryRow(Base):
    """A vehicle's telemetry at a moment, thinned; all vehicles of a mission have the same moments.

    ``at_s`` are Unix seconds by the service's clock, ``age_s`` the seconds since its last report.
    """

    __tablename__ = "telemetry"
    __table_args__ = (Index("ix_telemetry_mission", "mission_id", "at_s"),)

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    at_s: Mapped[float]
    depth_m: Mapped[float | None]
    altitude_m: Mapped[float | None]
    battery_pct: Mapped[float | None]
    age_s: Mapped[float | None]
