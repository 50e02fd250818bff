"""Queries on alarms and on what is told of them."""

from collections.abc import Collection, Sequence
from datetime import datetime

from sqlalchemy import ColumnElement, and_, exists, or_, select, update
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.ext.asyncio import AsyncSession
from sqlalchemy.orm import aliased

from app.storage.models import AlarmDeliveryRow, AlarmRow, MissionRow

WAITING, GIVEN_UP, SUPERSEDED = "waiting", "failed", "superseded"
"""States of deliveries: still to be made, tried for long enough, not needed any more."""
CALLS = ("raised", "escalated")
"""Notices that call somebody; the other ones tell those what became of the alarm."""


async def newest(
    session: AsyncSession, *, acknowledged: bool | None = None, mission_id: str | None = None, limit: int = 200
) -> Sequence[AlarmRow]:
    """Return alarms, newest first; ``acknowledged``: None for all."""
    query = select(AlarmRow).order_by(AlarmRow.raised_at.desc(), AlarmRow.id).limit(limit)
    if acknowledged is not None:
        query = query.where(
            AlarmRow.acknowledged_at.is_not(None) if acknowledged else AlarmRow.acknowledged_at.is_(None)
        )
    if mission_id is not None:
        query = query.where(AlarmRow.mission_id == mission_id)
    return (await session.scalars(query)).all()


async def standing(session: AsyncSession, mission_id: str) -> Sequence[AlarmRow]:
    """Return a mission's alarms whose causes are not over, acknowledged or not."""
    query = select(AlarmRow).where(AlarmRow.mission_id == mission_id, AlarmRow.ended_at.is_(None))
    return (await session.scalars(query)).all()


async def of_ids(session: AsyncSession, ids: Collection[str]) -> Sequence[AlarmRow]:
    """Return the alarms of these ids, as far as there are."""
    return (await session.scalars(select(AlarmRow).where(AlarmRow.id.in_(ids)))).all() if ids else []


async def held(session: AsyncSession, alarm_id: str) -> AlarmRow | None:
    """Return an alarm that no other transaction changes until this one ends."""
    query = select(AlarmRow).where(AlarmRow.id == alarm_id).with_for_update()
    return (await session.scalars(query)).first()


async def end(
    session: AsyncSession, mission_id: str, kinds: Collection[str], vehicle: str | None, at: datetime
) -> None:
    """Note that what raised a mission's alarms of some kinds is over, and that those who were told are to hear it."""
    query = update(AlarmRow).where(
        AlarmRow.mission_id == mission_id,
        AlarmRow.kind.in_(kinds),
        AlarmRow.vehicle.is_(None) if vehicle is None else AlarmRow.vehicle == vehicle,
        AlarmRow.ended_at.is_(None),
    )
    await session.execute(query.values(ended_at=at, next_at=at))


async def to_be_told(session: AsyncSession, at: datetime, limit: int) -> Sequence[AlarmRow]:
    """Return alarms of which somebody is to be told by now, and that no other transaction is at, oldest first."""
    query = select(AlarmRow).where(AlarmRow.next_at <= at).order_by(AlarmRow.next_at, AlarmRow.raised_at).limit(limit)
    return (await session.scalars(query.with_for_update(skip_locked=True))).all()


async def told_like(session: AsyncSession, alarm: AlarmRow, since: datetime) -> Sequence[AlarmRow]:
    """Return what was told of the same vehicle before, newest first: raised after ``since``, not acknowledged."""
    other = AlarmRow
    query = select(other).where(
        *_like(alarm), other.told_after_s.is_not(None), other.raised_at <= alarm.raised_at, other.raised_at > since
    )
    return (await session.scalars(query.order_by(other.raised_at.desc(), other.id))).all()


async def untold_like(session: AsyncSession, alarm: AlarmRow) -> Sequence[AlarmRow]:
    """Return what goes on like an alarm, of the same vehicle, and waits to be told."""
    other = AlarmRow
    query = select(other).where(
        *_like(alarm), other.told_after_s.is_(None), other.ended_at.is_(None), other.next_at.is_not(None)
    )
    return (await session.scalars(query)).all()


def _like(alarm: AlarmRow) -> list[ColumnElement[bool]]:
    """Return which others are of the same kind and vehicle, and that nobody acknowledged."""
    return [
        AlarmRow.mission_id == alarm.mission_id,
        AlarmRow.kind == alarm.kind,
        AlarmRow.vehicle.is_(None) if alarm.vehicle is None else AlarmRow.vehicle == alarm.vehicle,
        AlarmRow.acknowledged_at.is_(None),
        AlarmRow.id != alarm.id,
    ]


async def add_deliveries(session: AsyncSession, rows: Collection[AlarmDeliveryRow]) -> None:
    """Add deliveries; one that there is already stays as it is."""
    if not rows:
        return
    insert = sqlite.insert if session.get_bind().dialect.name == "sqlite" else postgresql.insert
    columns = [column.key for column in AlarmDeliveryRow.__table__.columns]
    values = [{name: getattr(row, name) for name in columns} for row in rows]
    await session.execute(insert(AlarmDeliveryRow).on_conflict_do_nothing(), values)


async def deliveries_of(session: AsyncSession, alarm_ids: Collection[str]) -> Sequence[AlarmDeliveryRow]:
    """Return what is told of alarms, oldest first."""
    query = (
        select(AlarmDeliveryRow)
        .where(AlarmDeliveryRow.alarm_id.in_(alarm_ids))
        .order_by(AlarmDeliveryRow.created_at, AlarmDeliveryRow.id)
    )
    return (await session.scalars(query)).all()


async def due(
    session: AsyncSession, at: datetime, *, but_not_to: Collection[str], limit: int
) -> Sequence[tuple[AlarmDeliveryRow, AlarmRow, str]]:
    """Return deliveries that nobody is at and whose time has come, each with its alarm and its mission's name."""
    query = (
        select(AlarmDeliveryRow, AlarmRow, MissionRow.name)
        .join(AlarmRow, AlarmRow.id == AlarmDeliveryRow.alarm_id)
        .outerjoin(MissionRow, MissionRow.id == AlarmRow.mission_id)
        .where(*_ready(at), AlarmDeliveryRow.recipient.not_in(list(but_not_to)))
        .order_by(AlarmDeliveryRow.next_try_at, AlarmDeliveryRow.id)
        .limit(limit)
        .with_for_update(of=AlarmDeliveryRow, skip_locked=True)
    )
    return [(delivery, alarm, name or "") for delivery, alarm, name in await session.execute(query)]


def _ready(at: datetime) -> list[ColumnElement[bool]]:
    """Return which deliveries can be made by now: an alarm's notices go to a recipient in their order."""
    before = aliased(AlarmDeliveryRow)
    first = and_(before.notice.in_(CALLS), AlarmDeliveryRow.notice.not_in(CALLS))
    return [
        AlarmDeliveryRow.state == WAITING,
        AlarmDeliveryRow.process_id.is_(None),
        AlarmDeliveryRow.next_try_at <= at,
        ~exists().where(
            before.alarm_id == AlarmDeliveryRow.alarm_id,
            before.recipient == AlarmDeliveryRow.recipient,
            before.id != AlarmDeliveryRow.id,
            before.state == WAITING,
            first | (before.created_at < AlarmDeliveryRow.created_at),
        ),
    ]


async def supersede(session: AsyncSession, at: datetime) -> None:
    """Settle what need not be told any more.

    That is a call of an alarm that was acknowledged, one further up of an alarm that is over, and what follows a call
    that was given up. What an attempt is under way for is left until that has failed.
    """
    call = aliased(AlarmDeliveryRow)
    given_up = exists().where(
        call.alarm_id == AlarmDeliveryRow.alarm_id,
        call.recipient == AlarmDeliveryRow.recipient,
        call.notice.in_(CALLS),
        call.state == GIVEN_UP,
    )
    taken = exists().where(AlarmRow.id == AlarmDeliveryRow.alarm_id, AlarmRow.acknowledged_at.is_not(None))
    over = exists().where(AlarmRow.id == AlarmDeliveryRow.alarm_id, AlarmRow.ended_at.is_not(None))
    query = update(AlarmDeliveryRow).where(
        AlarmDeliveryRow.state == WAITING,
        AlarmDeliveryRow.process_id.is_(None),
        or_(
            and_(AlarmDeliveryRow.notice.in_(CALLS), taken),
            and_(AlarmDeliveryRow.notice == CALLS[1], over),
            and_(AlarmDeliveryRow.notice.not_in(CALLS), given_up),
        ),
    )
    await session.execute(query.values(state=SUPERSEDED, done_at=at), execution_options={"synchronize_session": False})


async def anything_to_do(session: AsyncSession, at: datetime) -> bool:
    """Tell whether an alarm is to be told, or a delivery made, by now."""
    told = exists().where(AlarmRow.next_at <= at)
    made = exists().where(*_ready(at))
    return bool(await session.scalar(select(told | made)))


async def settle(session: AsyncSession, delivery_id: str, *, process: int | None, values: dict[str, object]) -> None:
    """Write down what came of an attempt; ``process``: only while that process is at it."""
    query = update(AlarmDeliveryRow).where(AlarmDeliveryRow.id == delivery_id, AlarmDeliveryRow.state == WAITING)
    if process is not None:
        query = query.where(AlarmDeliveryRow.process_id == process)
    await session.execute(query.values(values))
