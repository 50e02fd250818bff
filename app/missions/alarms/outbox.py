"""What is told of alarms, in the database: planned, taken by one process, settled, each within a transaction.

Two processes that plan the same make the same ids; what one has taken no other takes, until it is settled or the
process ends: its row goes then, and with it its name on the delivery.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.alarm_kinds import AlarmKind, AlarmSeverity
from app.missions.alarm_settings import AlarmSettings
from app.missions.alarms import routes
from app.missions.alarms.message import Message
from app.missions.alarms.raised import alarm_view
from app.missions.views.alarms import DeliveryState, Notice
from app.storage.models import AlarmDeliveryRow, AlarmRow, MissionRow
from app.storage.queries import alarms as alarm_queries

AT_ONCE = 200
"""Alarms that are planned in one transaction, and deliveries that are looked at to be taken."""
MOST_TOLD = 2
"""What comes and goes is told so often within ``repeat_after_s``; then it has to stay."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """A delivery that this process has taken.

    Attributes
    ----------
    attempts
        How many there were before.
    process
        Under whose number it was taken; 0: it is not in the database yet.
    """

    recipient: str
    message: Message
    attempts: int
    created_at: datetime
    process: int


def deliveries(
    settings: AlarmSettings, alarm: AlarmRow, mission_name: str, at: datetime
) -> tuple[list[AlarmDeliveryRow], datetime | None]:
    """Return what is to be told of an alarm by now, and when something is next."""
    ladder = routes.steps(
        settings, AlarmKind(alarm.kind), AlarmSeverity(alarm.severity), alarm.mission_id, mission_name
    )
    age_s = max(0.0, (at - alarm.raised_at).total_seconds())
    now, next_s = routes.due(ladder, alarm.told_after_s, age_s)
    made = [
        new_delivery(alarm.id, step.recipient, Notice.ESCALATED if step.after_s > 0 else Notice.RAISED, at)
        for step in now
    ]
    return made, None if next_s is None else alarm.raised_at + timedelta(seconds=next_s)


def new_delivery(alarm_id: str, recipient: str, notice: Notice, at: datetime) -> AlarmDeliveryRow:
    """Return a delivery that was not tried yet."""
    return AlarmDeliveryRow(
        id=routes.delivery_id(alarm_id, recipient, notice),
        alarm_id=alarm_id,
        recipient=recipient,
        notice=notice,
        state=DeliveryState.WAITING,
        attempts=0,
        created_at=at,
        next_try_at=at,
        done_at=None,
        error="",
        process_id=None,
    )


async def plan(session: AsyncSession, settings: AlarmSettings, at: datetime) -> None:
    """Store what is to be told by now of every alarm, and settle what need not be any more."""
    planned: list[AlarmDeliveryRow] = []
    for alarm in await alarm_queries.to_be_told(session, at, AT_ONCE):
        if alarm.next_at is None:
            continue  # told with one before it in this list
        first = alarm.told_after_s is None
        if alarm.ended_at is not None and not first:
            planned += await _end(session, settings, alarm, at)
            alarm.next_at = None
            continue
        until = await _held_until(session, settings, alarm, at) if first else None
        if until is not None:
            # What was over before its time has come is told to nobody.
            alarm.next_at = until if alarm.ended_at is None else None
            continue
        if first and alarm.ended_at is None and alarm.next_at > alarm.raised_at:
            await _tell_for_others(session, alarm)
        made, alarm.next_at = deliveries(settings, alarm, await _name(session, alarm), at)
        alarm.told_after_s = max(0.0, (at - alarm.raised_at).total_seconds())
        if alarm.ended_at is not None:
            alarm.next_at = None
        planned += made
    await session.flush()
    await alarm_queries.add_deliveries(session, planned)
    await alarm_queries.supersede(session, at)


async def _held_until(session: AsyncSession, settings: AlarmSettings, alarm: AlarmRow, at: datetime) -> datetime | None:
    """Return until when nobody is told of an alarm: the same was told shortly before. None: it is told now."""
    window = timedelta(seconds=settings.repeat_after_s)
    seen_at = at if alarm.ended_at is None else alarm.raised_at
    told = await alarm_queries.told_like(session, alarm, seen_at - window)
    goes_on = [other for other in told if other.ended_at is None or other.ended_at > alarm.raised_at]
    holding = goes_on[:1] or told[MOST_TOLD - 1 : MOST_TOLD]
    return holding[0].raised_at + window if holding else None


async def _tell_for_others(session: AsyncSession, alarm: AlarmRow) -> None:
    """Let an alarm that was held back stand for the others that were with it."""
    for other in await alarm_queries.untold_like(session, alarm):
        other.told_after_s, other.next_at = 0.0, None


async def keep_begun(session: AsyncSession, rows: Sequence[AlarmDeliveryRow], waiting: Collection[str]) -> set[str]:
    """Store deliveries that were begun from memory; returns which of the alarms that are ``waiting`` are stored now."""
    known = {row.id for row in await alarm_queries.of_ids(session, {row.alarm_id for row in rows}.union(waiting))}
    await alarm_queries.add_deliveries(session, [row for row in rows if row.alarm_id in known])
    return known


async def acknowledge(
    session: AsyncSession, settings: AlarmSettings, alarm: AlarmRow, actor: str, at: datetime
) -> None:
    """Let nobody be told any more that an alarm is open, and everybody who was be told who has taken it."""
    alarm.acknowledged_at, alarm.acknowledged_by = alarm.acknowledged_at or at, alarm.acknowledged_by or actor
    # That it is over is still told.
    alarm.next_at = alarm.next_at if alarm.ended_at is not None else None
    reached = _reached(await alarm_queries.deliveries_of(session, [alarm.id]))
    await session.flush()
    await alarm_queries.supersede(session, at)
    told = await _further(session, settings, alarm, reached, Notice.ACKNOWLEDGED, at)
    await alarm_queries.add_deliveries(session, told)


def _reached(deliveries_made: Sequence[AlarmDeliveryRow]) -> set[str]:
    """Return who knows of an alarm, or may."""
    return {
        row.recipient
        for row in deliveries_made
        if row.state == DeliveryState.DELIVERED
        or (row.state != DeliveryState.FAILED and (row.attempts or row.process_id is not None))
    }


async def _end(session: AsyncSession, settings: AlarmSettings, alarm: AlarmRow, at: datetime) -> list[AlarmDeliveryRow]:
    """Return what is told to those who know of an alarm whose cause is over; who does not yet hears both at once."""
    reached = _reached(await alarm_queries.deliveries_of(session, [alarm.id]))
    return await _further(session, settings, alarm, reached, Notice.ENDED, at)


async def _further(
    session: AsyncSession,
    settings: AlarmSettings,
    alarm: AlarmRow,
    reached: Collection[str],
    notice: Notice,
    at: datetime,
) -> list[AlarmDeliveryRow]:
    """Return what those who know of an alarm, and want to know what becomes of it, are told."""
    kind, severity, name = AlarmKind(alarm.kind), AlarmSeverity(alarm.severity), await _name(session, alarm)
    return [
        new_delivery(alarm.id, recipient, notice, at)
        for recipient in sorted(reached)
        if routes.hears_what_follows(settings, recipient, kind, severity, alarm.mission_id, name)
    ]


async def take(
    session: AsyncSession, at: datetime, process: int, busy: Collection[str], room: int
) -> Sequence[AlarmDeliveryRow]:
    """Take up to ``room`` deliveries whose time has come, one for each recipient that is not ``busy``."""
    taken: dict[str, AlarmDeliveryRow] = {}
    for row, _, _ in await alarm_queries.due(session, at, but_not_to=busy, limit=AT_ONCE):
        if len(taken) < room and row.recipient not in taken:
            row.process_id = process
            taken[row.recipient] = row
    return list(taken.values())


async def attempts(session: AsyncSession, rows: Sequence[AlarmDeliveryRow], process: int) -> list[Attempt]:
    """Return what is to be sent for deliveries that were taken."""
    alarms = {row.id: row for row in await alarm_queries.of_ids(session, {row.alarm_id for row in rows})}
    return [attempt_of(row, alarms[row.alarm_id], await _name(session, alarms[row.alarm_id]), process) for row in rows]


def attempt_of(row: AlarmDeliveryRow, alarm: AlarmRow, mission_name: str, process: int) -> Attempt:
    """Return what is to be sent for a delivery."""
    message = Message(row.id, Notice(row.notice), alarm_view(alarm), mission_name)
    return Attempt(row.recipient, message, row.attempts, row.created_at, process)


async def _name(session: AsyncSession, alarm: AlarmRow) -> str:
    if alarm.mission_id is None:
        return ""
    mission = await session.get(MissionRow, alarm.mission_id)
    return "" if mission is None else mission.name
