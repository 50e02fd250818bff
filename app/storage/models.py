"""The tables. Every change here needs a migration; a test compares the two."""

from datetime import UTC, datetime
from typing import Any, ClassVar

from sqlalchemy import (
    JSON,
    BigInteger,
    DateTime,
    Dialect,
    Double,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Text,
    TypeDecorator,
    UniqueConstraint,
    false,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column, relationship


class UtcDateTime(TypeDecorator[datetime]):
    """Aware datetimes, stored as UTC; SQLite has no time zones of its own."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Refuse naive values and convert to UTC."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError(f"naive datetime {value}: give it a time zone")
        value = value.astimezone(UTC)
        return value.replace(tzinfo=None) if dialect.name == "sqlite" else value

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Return an aware value."""
        return value.replace(tzinfo=UTC) if value is not None and value.tzinfo is None else value


_BigId = BigInteger().with_variant(Integer, "sqlite")


class Base(DeclarativeBase):
    """Base of all tables; constraint names are fixed so that migrations can find them."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(column_0_label)s",
            "uq": "uq_%(table_name)s_%(column_0_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
    type_annotation_map: ClassVar = {
        datetime: UtcDateTime(),
        float: Double(),
        dict[str, Any]: JSON(),
        dict[str, Any] | None: JSON(none_as_null=True),
    }


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
    changed_at: Mapped[datetime]


class VehicleOrderRow(Base):
    """What an operator ordered one vehicle to do in the middle of a mission, and what became of it."""

    __tablename__ = "vehicle_orders"
    __table_args__ = (Index("ix_vehicle_orders_mission", "mission_id", "id"),)

    id: Mapped[int] = mapped_column(_BigId, primary_key=True, autoincrement=True)
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


class SoundingRow(Base):
    """A measurement of the sea floor: raw values as they came, the corrected depth beside them."""

    __tablename__ = "soundings"
    __table_args__ = (
        UniqueConstraint("mission_id", "vehicle", "time_s", "beam", name="uq_soundings_identity"),
        Index("ix_soundings_mission", "mission_id", "id"),
    )

    id: Mapped[int] = mapped_column(_BigId, primary_key=True, autoincrement=True)
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


class TargetRangeRow(Base):
    """A range that a vehicle measured to a moving target, in the order in which they were judged."""

    __tablename__ = "target_ranges"
    __table_args__ = (
        UniqueConstraint("mission_id", "target", "vehicle", "time_s", name="uq_target_ranges_identity"),
        Index("ix_target_ranges_mission", "mission_id", "id"),
    )

    id: Mapped[int] = mapped_column(_BigId, primary_key=True, autoincrement=True)
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
    left out.
    """

    __tablename__ = "scans"
    __table_args__ = (
        UniqueConstraint("mission_id", "vehicle", "time_s", name="uq_scans_identity"),
        Index("ix_scans_mission", "mission_id", "id"),
    )

    id: Mapped[int] = mapped_column(_BigId, primary_key=True, autoincrement=True)
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

    id: Mapped[int] = mapped_column(_BigId, primary_key=True, autoincrement=True)
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


class PingChunkRow(Base):
    """A file with what blocks of a vehicle's pings held, which are removed in the transaction that adds this row."""

    __tablename__ = "ping_chunks"
    __table_args__ = (
        UniqueConstraint("name", name="uq_ping_chunks_name"),
        Index("ix_ping_chunks_mission", "mission_id", "id"),
        Index("ix_ping_chunks_times", "mission_id", "vehicle", "last_time_s"),
    )

    id: Mapped[int] = mapped_column(_BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    name: Mapped[str] = mapped_column(String(200))
    """Below the folder of all missions."""
    first_block: Mapped[int] = mapped_column(_BigId)
    last_block: Mapped[int] = mapped_column(_BigId)
    """It holds every block of the vehicle between the two."""
    first_time_s: Mapped[float]
    last_time_s: Mapped[float]
    pings: Mapped[int]
    beams: Mapped[int]
    rejected: Mapped[int]
    times: Mapped[bytes] = mapped_column(LargeBinary)
    digest: Mapped[str] = mapped_column(String(64))
    """SHA-256 of the file."""
    size: Mapped[int] = mapped_column(_BigId)


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
    last_sounding: Mapped[int] = mapped_column(_BigId)
    last_import: Mapped[int] = mapped_column(_BigId)
    last_block: Mapped[int] = mapped_column(_BigId)
    summary: Mapped[dict[str, Any]]
    digest: Mapped[str] = mapped_column(String(64))
    """SHA-256 of the content."""
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
    last_sounding: Mapped[int] = mapped_column(_BigId)
    last_import: Mapped[int] = mapped_column(_BigId)
    accepted: Mapped[int]
    rejected: Mapped[int]
    """Soundings that there were; the map may be of fewer."""
    soundings: Mapped[int]
    thorough: Mapped[bool]
    digest: Mapped[str] = mapped_column(String(64))
    content: Mapped[bytes] = mapped_column(LargeBinary)


class PositionRow(Base):
    """A point of a vehicle's track, thinned."""

    __tablename__ = "positions"
    __table_args__ = (Index("ix_positions_track", "mission_id", "vehicle", "id"),)

    id: Mapped[int] = mapped_column(_BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    time_s: Mapped[float]
    """By the vehicle's clock, which may be reset."""
    lat_deg: Mapped[float]
    lon_deg: Mapped[float]
    depth_m: Mapped[float]
    imported: Mapped[bool] = mapped_column(default=False, server_default=false())
    """Whether a log brought it later; else ids are in the order in which positions arrived."""


class TelemetryRow(Base):
    """A vehicle's telemetry at a moment, thinned; all vehicles of a mission have the same moments.

    ``at_s`` are Unix seconds by the service's clock, ``age_s`` the seconds since its last report.
    """

    __tablename__ = "telemetry"
    __table_args__ = (Index("ix_telemetry_mission", "mission_id", "at_s"),)

    id: Mapped[int] = mapped_column(_BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    vehicle: Mapped[str] = mapped_column(String(64))
    at_s: Mapped[float]
    depth_m: Mapped[float | None]
    altitude_m: Mapped[float | None]
    battery_pct: Mapped[float | None]
    age_s: Mapped[float | None]


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

    id: Mapped[int] = mapped_column(_BigId, primary_key=True, autoincrement=True)
    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"))
    time: Mapped[datetime]
    level: Mapped[str] = mapped_column(String(16))
    kind: Mapped[str] = mapped_column(String(32))
    message: Mapped[str] = mapped_column(Text)
    data: Mapped[dict[str, Any]]
    alarm: Mapped["AlarmRow | None"] = relationship(lazy="raise", passive_deletes=True)
    """What it raised; only of rows that are being written."""


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
    event_id: Mapped[int | None] = mapped_column(_BigId, ForeignKey("events.id", ondelete="CASCADE"), index=True)
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
    """raised, escalated or acknowledged."""
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


class TokenRow(Base):
    """An access token; only its hash is kept."""

    __tablename__ = "tokens"

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    name: Mapped[str] = mapped_column(String(120))
    role: Mapped[str] = mapped_column(String(16))
    vehicle: Mapped[str | None] = mapped_column(String(64))
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    created_at: Mapped[datetime]
    expires_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]


class SessionRow(Base):
    """A browser that signed in with an access token: what it shows from then on is not the token. Ends with it."""

    __tablename__ = "sessions"

    secret_hash: Mapped[str] = mapped_column(String(64), primary_key=True)
    token_hash: Mapped[str] = mapped_column(ForeignKey("tokens.token_hash", ondelete="CASCADE"), index=True)
    created_at: Mapped[datetime]
    expires_at: Mapped[datetime]


class AuditRow(Base):
    """Somebody's command and what came of it. The database refuses changes, and removals before 30 days are over.

    Without a foreign key to missions: what was done with one is kept when it is removed.
    """

    __tablename__ = "audit"
    __table_args__ = (Index("ix_audit_time", "time"),)

    id: Mapped[int] = mapped_column(_BigId, primary_key=True, autoincrement=True)
    time: Mapped[datetime]
    actor: Mapped[str] = mapped_column(String(120))
    role: Mapped[str] = mapped_column(String(16))
    origin: Mapped[str] = mapped_column(String(64))
    """The address that the command came from, or ``command line``."""
    action: Mapped[str] = mapped_column(String(64))
    target: Mapped[str] = mapped_column(String(300))
    mission_id: Mapped[str | None] = mapped_column(String(64))
    result: Mapped[str] = mapped_column(String(16))
    """done, refused or failed."""
    status: Mapped[int | None]
    """The HTTP status of the answer."""
    detail: Mapped[str] = mapped_column(Text)
    request_id: Mapped[str] = mapped_column(String(64))
