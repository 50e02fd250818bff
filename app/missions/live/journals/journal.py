"""What a mission writes down as it goes: soundings, tracks, waypoint states and its log.

A sounding counts as accepted only when the transaction that stores it has committed.
"""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, TypeVar

import numpy as np
import structlog
from sqlalchemy.ext.asyncio import AsyncSession

from app.mapping.coordinates.distances import horizontal_distance_m
from app.mapping.swath.pings import Pings
from app.missions import metrics
from app.missions.alarm_kinds import ALARMS, AlarmKind
from app.missions.alarms.raised import copy_of, make_alarm
from app.missions.clock import now
from app.missions.fleet.interface import PingReport, ScanReport, SoundingReport, VehicleReport, WaypointReport
from app.missions.flown import Flown, is_flown
from app.missions.large_batches import made_of
from app.missions.live.journals.db_retry import DatabaseRetry
from app.missions.live.journals.write_behind import Committed, WriteBehind
from app.missions.live.watchers.alarms import MissionAlarms
from app.missions.live.watchers.broadcast import Broadcaster
from app.missions.pings.store import JudgedBatch, PingStore, TakenPings
from app.missions.soundings.corrections import PlacedSounding
from app.missions.soundings.gate import Gate
from app.missions.views.measurements.soundings import ItemVerdict, Verdict
from app.missions.views.messages import EventMessage
from app.missions.views.mission import EventView, Level
from app.missions.views.telemetry import VehicleSample
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.database import Database
from app.storage.models import AlarmRow, EventRow
from app.storage.queries import alarms as alarm_queries
from app.storage.queries import missions as mission_queries
from app.storage.queries import soundings as sounding_queries
from app.storage.queries import telemetry as telemetry_queries
from app.storage.queries.logs import NO_LEVEL

FLUSH_PERIOD_S = 0.1
ENDS = "ends"
"""What a line's data name the kinds of alarms by that it ends."""
TRACK_SPACING_M = 1.0

TakeScans = Callable[[Sequence[ScanReport], int, AsyncSession], Awaitable[tuple[list[ItemVerdict], Committed]]]
"""Stores scans of a step in a transaction; returns the verdicts and what to call once it has committed."""

Noted = SoundingReport | PingReport | ScanReport | VehicleReport | WaypointReport | VehicleSample | EventRow
"""What a journal writes; of a vehicle's report its place."""

T = TypeVar("T")

RISES = "rises"
"""Marks events that tell of a vehicle sent up for a fix."""

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class Counts:
    """What a mission measured so far: soundings, and pings of swath sonars with their beams."""

    accepted: int = 0
    rejected: int = 0
    pings: int = 0
    """Accepted ones."""
    beams: int = 0
    rejected_pings: int = 0

    @property
    def any_accepted(self) -> bool:
        """Whether any sounding or ping counts."""
        return self.accepted + self.pings > 0

    def of_soundings(self, accepted: int, rejected: int) -> "Counts":
        """Return the same with other numbers of soundings."""
        return replace(self, accepted=accepted, rejected=rejected)


class Journal(WriteBehind[Noted]):
    """Writes one mission's records.

    Parameters
    ----------
    on_accepted
        Called with every committed batch of accepted soundings, shape (n, 4): east, north, depth, sd.
    pings
        Keeps pings.
    on_pings
        Called with the accepted pings, by vehicle, of every transaction that committed.
    on_trouble
        Called when the database cannot be used any more, or can be again.
    take_scans
        Stores scans; None in missions that have no use for any.
    """

    def __init__(
        self,
        database: Database,
        mission_id: str,
        gate: Gate,
        counts: Counts,
        broadcaster: Broadcaster,
        on_accepted: Callable[[np.ndarray[Any, np.dtype[np.float64]]], None],
        pings: PingStore,
        on_pings: Callable[[Mapping[str, Pings]], None],
        on_trouble: Callable[[], None],
        take_scans: TakeScans | None = None,
    ) -> None:
        super().__init__(
            database,
            mission_id,
            DatabaseRetry(mission_id, on_trouble, self._begin_trouble, self._note_trouble),
            FLUSH_PERIOD_S,
        )
        self._gate = gate
        self._broadcaster = broadcaster
        self.alarms = MissionAlarms(mission_id, broadcaster)
        """Those of the mission that nobody has acknowledged."""
        self._trouble: AlarmRow | None = None
        """Raised when the database could not be written; its line comes when it can be again."""
        self._on_accepted = on_accepted
        self._pings = pings
        self._on_pings = on_pings
        self._take_scans = take_scans
        self.counts = counts
        self.travelled_m = 0.0
        self.step = 0
        self._logging = asyncio.Lock()
        """Held while lines are written and told: nobody sees them in another order."""
        self._told_of_missing_level = False
        self._untold = ""
        self._track_ends: dict[str, tuple[float, float]] = {}
        self._heard_s: dict[str, float] = {}
        """By vehicle the time of its last position, noted or not."""
        self._flown: dict[str, Flown] = {}
        """By vehicle what it has flown, to be written with its positions."""

    def sounding(self, report: SoundingReport) -> None:
        """Note a sounding; it is written within a moment."""
        self._note(report)

    def ping(self, report: PingReport) -> None:
        """Note a ping; it is written within a moment."""
        self._note(report)

    def scan(self, report: ScanReport) -> None:
        """Note a look round; it is written within a moment, in a mission that has use for it."""
        if self._take_scans is not None:
            self._note(report)

    def position(self, report: VehicleReport, flown: Flown | None = None) -> None:
        """Note a point of a track, unless it is close to the last one.

        ``flown``: what its vehicle has flown so far, which is written with the track; None where that stays as it is.
        """
        end = report.position.lat_lon
        last = self._track_ends.get(report.vehicle)
        passed_s = report.time_s - self._heard_s.get(report.vehicle, report.time_s)
        self._heard_s[report.vehicle] = report.time_s
        if last is not None:
            leg_m = horizontal_distance_m(last, end)
            if leg_m < TRACK_SPACING_M:
                return
            self.travelled_m += leg_m if is_flown(leg_m, passed_s) else 0.0
        self._track_ends[report.vehicle] = end
        if flown is not None:
            self._flown[report.vehicle] = flown
        self._note(report)

    def waypoint(self, report: WaypointReport) -> None:
        """Note what became of a waypoint."""
        self._note(report)

    def telemetry(self, samples: Sequence[VehicleSample]) -> None:
        """Note what the vehicles told of themselves."""
        self._note(*samples)

    def note_line(self, row: EventRow) -> None:
        """Note a line; it is written within a moment, or when that is possible again. An alarm is shown at once."""
        self._note_lines(row)

    def _note_lines(self, *rows: EventRow) -> None:
        for row in rows:
            if row.alarm is not None:
                self.alarms.noted(row.alarm)
        self._note(*rows)

    async def flush(self) -> None:
        """Write everything noted so far. What could not be written stays noted."""
        await super().flush()
        if self._untold:
            why, self._untold = self._untold, ""
            await self.alarm(
                AlarmKind.NO_WATER_LEVEL, f"soundings are rejected: {why}. Send a tide table that covers them"
            )

    async def _store(self, noted: Sequence[Noted], session: AsyncSession) -> Committed:
        gated, new = await self._store_soundings(session, _of(SoundingReport, noted))
        pings = _of(PingReport, noted)
        _, pinged = await self.take_pings([await self._pings.judge(pings)] if pings else [], session)
        _, seen = await self.take_scans(_of(ScanReport, noted), session)
        positions = [position_row(self.mission_id, report) for report in _of(VehicleReport, noted)]
        await mission_queries.add_positions(session, positions)
        # With the track, so that a restart after a failure goes on from the same place with both.
        moved = {row["vehicle"] for row in positions} & self._flown.keys()
        flown = {name: self._flown[name].remember() for name in sorted(moved)}
        await mission_queries.keep_flown(session, self.mission_id, flown)
        samples = [{"mission_id": self.mission_id} | asdict(sample) for sample in _of(VehicleSample, noted)]
        await telemetry_queries.add(session, samples)
        # Rows of a transaction that failed cannot be written again.
        rows = [_copy(row) for row in _of(EventRow, noted)]
        await add_lines(session, rows)
        for report in _of(WaypointReport, noted):
            where = (self.mission_id, report.step, report.vehicle)
            await mission_queries.set_waypoint_status(
                session, *where, report.status, report.reason, now(), begun=report.begun
            )

        def committed() -> None:
            self._count(gated, new)
            pinged()
            seen()
            for row in rows:
                self.tell(row)

        return committed

    async def take_pings(
        self, batches: Sequence[JudgedBatch], session: AsyncSession, *, log: int | None = None
    ) -> tuple[Sequence[ItemVerdict], Committed]:
        """Store pings in the caller's transaction; the caller holds ``writing``. ``log``: that brings them.

        Returns
        -------
        The verdicts in the order of the batches and in theirs, and what to call once the transaction has committed.
        """
        if not batches:
            return [], lambda: None
        taken = await self._pings.take(batches, self.step, session, log=log)
        return taken.verdicts, lambda: self._count_pings(taken)

    def _count_pings(self, taken: TakenPings) -> None:
        new, counts = taken.totals, self.counts
        self.counts = replace(
            counts,
            pings=counts.pings + new.pings,
            beams=counts.beams + new.beams,
            rejected_pings=counts.rejected_pings + new.rejected,
        )
        metrics.PINGS.labels(Verdict.ACCEPTED).inc(new.pings)
        metrics.PINGS.labels(Verdict.REJECTED).inc(new.rejected)
        metrics.PINGS.labels(Verdict.DUPLICATE).inc(sum(v.verdict is Verdict.DUPLICATE for v in taken.verdicts))
        metrics.BEAMS.inc(new.beams)
        self._pings.committed(taken)
        if taken.accepted:
            self._on_pings(taken.accepted)

    async def take_scans(
        self, reports: Sequence[ScanReport], session: AsyncSession
    ) -> tuple[list[ItemVerdict], Committed]:
        """Store scans in the caller's transaction; the caller holds ``writing``.

        Returns
        -------
        The verdicts in the order of the reports, and what to call once the transaction has committed.
        """
        if self._take_scans is None or not reports:
            return [], lambda: None
        return await self._take_scans(reports, self.step, session)

    async def take(
        self,
        reports: Sequence[SoundingReport],
        session: AsyncSession,
        *,
        gate: Gate | None = None,
        log: int | None = None,
    ) -> tuple[list[ItemVerdict], Committed]:
        """Store soundings in the caller's transaction; the caller holds ``writing``.

        ``gate`` judges them in place of the mission's own; ``log`` is the number of the log that brings them.

        Returns
        -------
        The verdicts in the order of the reports, and what to call once the transaction has committed.
        """
        gated, new = await self._store_soundings(session, reports, gate, log)
        return await made_of(gated, _verdicts, gated, new), lambda: self._count(gated, new)

    async def log(self, level: Level, kind: str, message: str, **data: Any) -> None:
        """Write a line of the mission's log and show it to everyone who watches.

        Where the database cannot be written the line is noted like a sounding: nobody who has to tell something waits.
        """
        await self.log_all([self.line(level, kind, message, **data)])

    async def alarm(self, kind: AlarmKind, message: str, *, event: str | None = None, **data: Any) -> None:
        """Raise an alarm: a line of the log as by :meth:`log`, and what has to be acknowledged."""
        await self.log_all([self.alarm_line(kind, message, event=event, **data)])

    async def log_all(self, rows: Sequence[EventRow]) -> None:
        """Write lines of the mission's log together and show them; what cannot be written is noted, as by :meth:`log`.

        Parameters
        ----------
        rows
            Made by :meth:`line` or :meth:`alarm_line`.
        """
        if self.storage.trouble or _of(EventRow, self._noted):
            self._note_lines(*rows)
            return
        copies = [_copy(row) for row in rows]
        async with self._logging:
            try:
                await to_the_end(self._add(*rows))
            except Exception as error:
                self.storage.note(error)
                self._note_lines(*copies)

    async def write(self, row: EventRow) -> None:
        """Write a line now and show it; raises when that cannot be."""
        async with self._logging:
            await to_the_end(self._add(row))

    async def _add(self, *rows: EventRow) -> None:
        """Write lines and show them: whoever is cancelled meanwhile, what is stored is seen."""
        async with self._database.writing() as session:
            await add_lines(session, rows)
        for row in rows:
            self.tell(row)

    def _begin_trouble(self, trouble: str) -> None:
        """Raise an alarm that nothing can be written: it is told before it can be stored."""
        words = f"nothing can be written down: {trouble}"
        self._trouble = make_alarm(AlarmKind.DATABASE_UNWRITABLE, self.mission_id, words, now())
        self.alarms.noted(self._trouble)

    def _note_trouble(self, message: str) -> None:
        line = self.alarm_line(AlarmKind.DATABASE_UNWRITABLE, message)
        if self._trouble is not None:
            self._trouble.message, line.alarm, self._trouble = message, self._trouble, None
        if line.alarm is not None:
            line.alarm.ended_at = line.time
        self.note_line(line)

    def line(self, level: Level, kind: str, message: str, **data: Any) -> EventRow:
        """Return a line of the mission's log for a transaction of the caller's; ``tell`` of it once that is done.

        Lines of level alarm are made by :meth:`alarm_line`.
        """
        return EventRow(
            mission_id=self.mission_id, time=now(), level=level, kind=kind, message=message, data=data, alarm=None
        )

    def alarm_line(self, kind: AlarmKind, message: str, *, event: str | None = None, **data: Any) -> EventRow:
        """Return a line that raises an alarm, which is stored with it, for a transaction as that of :meth:`line`.

        ``event`` is the line's kind where it is not the one that the table of alarms has.
        """
        row = self.line(Level.ALARM, event or ALARMS[kind].event, message, **data)
        row.alarm = make_alarm(kind, self.mission_id, message, row.time, vehicle=data.get("vehicle"))
        return row

    def end_line(self, kinds: Sequence[AlarmKind], message: str, *, event: str | None = None, **data: Any) -> EventRow:
        """Return a line that ends alarms of some kinds, those of the vehicle that is named or of the mission.

        They stay open until somebody acknowledges them; nobody else is called.
        """
        ends = {ENDS: [str(kind) for kind in kinds]}
        return self.line(Level.INFO, event or ALARMS[kinds[0]].event, message, **data | ends)

    async def end(self, kinds: Sequence[AlarmKind], message: str, *, event: str | None = None, **data: Any) -> None:
        """Write the line of :meth:`end_line`."""
        await self.log_all([self.end_line(kinds, message, event=event, **data)])

    def tell(self, row: EventRow) -> None:
        """Show a line that was written to everyone who watches."""
        metrics.EVENTS.labels(row.level).inc()
        said = {"mission": self.mission_id, "level": str(row.level), "kind": row.kind, "message": row.message}
        log.info("mission event", **(row.data | said))
        self._broadcaster.publish(EventMessage(event=event_view(row)))
        if row.alarm is not None:
            self.alarms.stored(row.alarm)
        if row.data.get(ENDS):
            self.alarms.ended(row.data[ENDS], row.data.get("vehicle"), row.time)

    def tell_of_missing_level(self) -> None:
        """Write into the log again, once, when no water level is known for soundings."""
        self._told_of_missing_level = False

    async def count_again(self, read: Callable[[], Awaitable[Counts]]) -> None:
        """Let ``read`` take up what another process has written, while nothing is written here."""
        await self.flush()
        async with self.writing:
            self.counts = await read()

    async def _store_soundings(
        self,
        session: AsyncSession,
        reports: Sequence[SoundingReport],
        gate: Gate | None = None,
        log: int | None = None,
    ) -> tuple[list[PlacedSounding], set[sounding_queries.Identity]]:
        gated, rows = await made_of(reports, self._gated, reports, gate or self._gate, log)
        again = bool(self._pings.taken_back)
        return gated, await sounding_queries.insert_new(session, rows, any_taken_back=again)

    def _gated(
        self, reports: Sequence[SoundingReport], gate: Gate, log: int | None
    ) -> tuple[list[PlacedSounding], list[dict[str, Any]]]:
        """Return soundings as the gate judges them, and how they are stored."""
        gated, received = gate.check(reports), now()
        rows = [_row(self.mission_id, self.step, received, item) for item in gated if _storable(item)]
        return gated, [row | {"log": log} for row in rows]

    def _count(self, gated: Sequence[PlacedSounding], new: set[sounding_queries.Identity]) -> None:
        first = {_identity(item.report): item for item in reversed(gated) if _storable(item)}
        fresh = [item for identity, item in first.items() if identity in new]
        accepted = [item for item in reversed(fresh) if item.accepted]
        rejected = len(fresh) - len(accepted)
        no_level = next((item.reason for item in fresh if item.reason.startswith(NO_LEVEL)), "")
        if no_level and not self._told_of_missing_level:
            self._told_of_missing_level, self._untold = True, no_level.removeprefix(NO_LEVEL)
        self.counts = self.counts.of_soundings(self.counts.accepted + len(accepted), self.counts.rejected + rejected)
        metrics.SOUNDINGS.labels(Verdict.ACCEPTED).inc(len(accepted))
        metrics.SOUNDINGS.labels(Verdict.REJECTED).inc(rejected)
        metrics.SOUNDINGS.labels(Verdict.DUPLICATE).inc(len(gated) - len(fresh))
        if accepted:
            self._on_accepted(np.array([(s.east_m, s.north_m, s.depth_m, s.sd_m) for s in accepted]))


def position_row(mission_id: str, report: VehicleReport) -> dict[str, Any]:
    """Return a point of a vehicle's track as it is stored when it was heard."""
    place = report.position
    return {
        "mission_id": mission_id,
        "vehicle": report.vehicle,
        "time_s": report.time_s,
        "lat_deg": place.lat_deg,
        "lon_deg": place.lon_deg,
        "depth_m": place.depth_m,
        "imported": False,
    }


def event_view(row: EventRow) -> EventView:
    """Return a log line as it is shown."""
    return EventView(
        id=row.id,
        mission_id=row.mission_id,
        time=row.time,
        level=Level(row.level),
        kind=row.kind,
        message=row.message,
        data=row.data,
    )


def _of(kind: type[T], noted: Sequence[Noted]) -> list[T]:
    return [item for item in noted if isinstance(item, kind)]


async def add_lines(session: AsyncSession, rows: Sequence[EventRow]) -> None:
    """Add lines with the alarms that they raise, and end those that they end."""
    session.add_all(rows)
    for row in rows:
        if row.data.get(ENDS):
            # After those that were raised before it.
            await session.flush()
            await alarm_queries.end(session, row.mission_id, row.data[ENDS], row.data.get("vehicle"), row.time)


def _copy(row: EventRow) -> EventRow:
    return EventRow(
        mission_id=row.mission_id,
        time=row.time,
        level=row.level,
        kind=row.kind,
        message=row.message,
        data=row.data,
        alarm=None if row.alarm is None else copy_of(row.alarm),
    )


def _identity(report: SoundingReport) -> sounding_queries.Identity:
    return report.vehicle, report.time_s, report.beam


def _verdicts(gated: Sequence[PlacedSounding], new: set[sounding_queries.Identity]) -> list[ItemVerdict]:
    """Return the verdicts on soundings of which those in ``new`` were stored."""
    left = set(new)
    verdicts = []
    for index, item in enumerate(gated):
        identity = _identity(item.report)
        if _storable(item) and identity not in left:
            verdicts.append(ItemVerdict(index=index, verdict=Verdict.DUPLICATE, reason="already stored"))
            continue
        if _storable(item):
            left.discard(identity)
        verdict = Verdict.ACCEPTED if item.accepted else Verdict.REJECTED
        verdicts.append(ItemVerdict(index=index, verdict=verdict, reason=item.reason))
    return verdicts


def _storable(item: PlacedSounding) -> bool:
    # NaN and infinity have no place in a database column that is summed later; the verdict still goes out.
    report = item.report
    place = report.footprint
    finite = math.isfinite
    return (
        finite(report.time_s)
        and finite(report.range_m)
        and finite(report.vehicle_depth_m)
        and finite(place.lat_deg)
        and finite(place.lon_deg)
        and finite(place.depth_m)
    )


def _row(mission_id: str, step: int, received: Any, item: PlacedSounding) -> dict[str, Any]:
    report = item.report
    geometry = report.beam_geometry
    return {
        "mission_id": mission_id,
        "vehicle": report.vehicle,
        "time_s": report.time_s,
        "beam": report.beam,
        "received_at": received,
        "step": step,
        "source": report.source,
        "lat_deg": report.footprint.lat_deg,
        "lon_deg": report.footprint.lon_deg,
        "east_m": item.east_m,
        "north_m": item.north_m,
        "vehicle_depth_m": report.vehicle_depth_m,
        "range_m": report.range_m,
        "raw_depth_m": report.footprint.depth_m,
        "depth_m": item.depth_m,
        "sd_m": item.sd_m,
        "position_sd_m": report.position_sd_m,
        "level_m": item.level_m,
        "vehicle_lat_deg": geometry and geometry.lat_deg,
        "vehicle_lon_deg": geometry and geometry.lon_deg,
        "roll_deg": geometry and geometry.roll_deg,
        "pitch_deg": geometry and geometry.pitch_deg,
        "heading_deg": geometry and geometry.heading_deg,
        "beam_azimuth_deg": geometry and geometry.azimuth_deg,
        "beam_off_nadir_deg": geometry and geometry.off_nadir_deg,
        "verdict": Verdict.ACCEPTED if item.accepted else Verdict.REJECTED,
        "reason": item.reason,
    }
