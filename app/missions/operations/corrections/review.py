"""Soundings that are not in the map, and an operator's word on any of them: it counts, or it does not."""

from collections.abc import Sequence

from sqlalchemy import ColumnElement, and_, case, func, or_, select
from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.errors import ConflictError, SoundingNotFoundError
from app.missions.live.mission import LiveMission
from app.missions.operations.corrections.recorrection import report_of
from app.missions.soundings.gate import implausible_value
from app.missions.views.measurements.soundings import (
    RefusedRuling,
    Ruling,
    RulingsView,
    SoundingPage,
    SoundingPoints,
    SoundingState,
    SoundingView,
    Verdict,
)
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.models import EventRow, SoundingRow
from app.storage.queries import soundings as sounding_queries
from app.storage.queries import stored_maps

NO_DEPTH = "no depth can be had from it"
COVER_IT = "send a tide table that covers its time, or leave it out"

CHUNK = 500
"""Soundings that are asked for, or changed, at a time: others get their turn in between."""

Doubts = dict[int, str]
"""Why the map leaves accepted soundings out, by their ids."""


async def soundings_page(
    live: LiveMission,
    states: Sequence[SoundingState],
    *,
    vehicle: str | None = None,
    after: int = 0,
    limit: int = 200,
) -> SoundingPage:
    """Return up to ``limit`` soundings in any of the states with an id above ``after``, in the order they came.

    Raises VehicleNotFoundError when ``vehicle`` never took part.
    """
    await live.journal.flush()
    async with live.database.reading() as session:
        doubts = await _doubts(live, session)
        wanted = [*_are_there(live), or_(*(_condition(state, doubts) for state in states))]
        if vehicle is not None:
            await _check_known(live, session, vehicle)
            wanted.append(SoundingRow.vehicle == vehicle)
        total = await session.scalar(select(func.count()).select_from(SoundingRow).where(*wanted))
        query = select(SoundingRow).where(*wanted, SoundingRow.id > after).order_by(SoundingRow.id).limit(limit + 1)
        rows = (await session.scalars(query)).all()
    return SoundingPage(
        total=total or 0,
        items=[_view(row, doubts) for row in rows[:limit]],
        next_after=rows[limit - 1].id if len(rows) > limit else None,
    )


def _are_there(live: LiveMission) -> tuple[ColumnElement[bool], ...]:
    """Return the conditions of a mission's soundings, but for those whose log was taken back."""
    return SoundingRow.mission_id == live.id, SoundingRow.verdict != sounding_queries.TAKEN_BACK


async def _check_known(live: LiveMission, session: AsyncSession, vehicle: str) -> None:
    """Raise VehicleNotFoundError for a vehicle that neither takes part or did, nor has a sounding."""
    if vehicle in live.team.departed:
        return
    sounded = select(SoundingRow.id).where(SoundingRow.mission_id == live.id, SoundingRow.vehicle == vehicle).limit(1)
    if await session.scalar(sounded) is None:
        live.team.named(vehicle)


async def rule(live: LiveMission, sounding_id: int, ruling: Ruling, *, note: str = "", actor: str) -> SoundingView:
    """Restore a sounding or reject it; the map is that of the new choice when this returns. Raw values stay.

    Raises
    ------
    SoundingNotFoundError, ConflictError
        The latter when no depth can be had from what was measured.
    """
    await live.journal.flush()
    async with live.journal.writing:
        line = await to_the_end(_store(live, sounding_id, ruling, note, actor))
    if line is not None:
        live.journal.tell(line)
        live.changed.set()
    await live.map.build()
    live.publish_summary()
    async with live.database.reading() as session:
        row = await session.get_one(SoundingRow, sounding_id)
        return _view(row, await _doubts(live, session))


async def rule_many(
    live: LiveMission, ids: Sequence[int], ruling: Ruling, *, note: str = "", actor: str
) -> RulingsView:
    """Restore many soundings or reject them, in one transaction; the map is that of the new choice when this returns.

    Those that no depth can be had from are not restored, and told. Raises SoundingNotFoundError where one is not in
    this mission: then nothing is changed.
    """
    await live.journal.flush()
    async with live.journal.writing:
        line, result = await to_the_end(_store_many(live, sorted(set(ids)), ruling, note, actor))
    if line is not None:
        live.journal.tell(line)
        live.changed.set()
        await live.map.build()
        live.publish_summary()
    return result


async def _store_many(
    live: LiveMission, ids: list[int], ruling: Ruling, note: str, actor: str
) -> tuple[EventRow | None, RulingsView]:
    changed: list[int] = []
    refused: list[RefusedRuling] = []
    accepted = 0
    said = f": {note}" if note else ""
    async with live.database.writing() as session:
        doubts = await _doubts(live, session)
        for first in range(0, len(ids), CHUNK):
            part = ids[first : first + CHUNK]
            query = select(SoundingRow).where(SoundingRow.mission_id == live.id, SoundingRow.id.in_(part))
            rows = (await session.scalars(query.order_by(SoundingRow.id))).all()
            if len(rows) < len(part):
                missing = min(set(part) - {row.id for row in rows})
                raise SoundingNotFoundError(
                    f"there is no sounding {missing} in this mission",
                    "GET /api/v1/missions/{id}/soundings/points lists them",
                )
            for row in rows:
                if row.ruling == ruling:
                    continue
                was_accepted = row.verdict == Verdict.ACCEPTED
                before = row.reason or doubts.get(row.id, "")
                try:
                    _decide(live, row, ruling, f"{ruling} by {actor}{said}", before)
                except ConflictError as error:
                    refused.append(RefusedRuling(id=row.id, reason=str(error)))
                    continue
                accepted += int(row.verdict == Verdict.ACCEPTED) - int(was_accepted)
                changed.append(row.id)
            await session.flush()
            session.expunge_all()
        result = RulingsView(changed=changed, unchanged=len(ids) - len(changed) - len(refused), refused=refused)
        if not changed:
            return None, result
        what = "sounding" if len(changed) == 1 else "soundings"
        words = f"{len(changed)} {what} {ruling} by {actor}{said}"
        line = live.journal.line(
            Level.INFO, "sounding", words, soundings=len(changed), ruling=str(ruling), actor=actor, note=note
        )
        session.add(line)
        await session.flush()
        await stored_maps.forget(session, live.id)
    counts = live.counts
    live.recount(counts.of_soundings(counts.accepted + accepted, counts.rejected - accepted))
    return line, result


def _decide(live: LiveMission, row: SoundingRow, ruling: Ruling, reason: str, before: str) -> None:
    """Give a sounding its verdict. Raises ConflictError where it cannot be restored; then it is as it was."""
    if row.verdict == sounding_queries.TAKEN_BACK:
        raise ConflictError(f"sounding {row.id} came by a log that was taken back", "send the log again")
    if ruling is Ruling.RESTORED:
        _correct(live, row)
        row.verdict = Verdict.ACCEPTED
        row.reason = reason + (f" (before: {before})" if before else "")
    else:
        row.verdict = Verdict.REJECTED
        row.reason = reason
    row.ruling = ruling


async def sounding_points(live: LiveMission, *, after: int = 0, limit: int) -> SoundingPoints:
    """Return up to ``limit`` soundings with an id above ``after`` as points, whatever became of them."""
    await live.journal.flush()
    async with live.database.reading() as session:
        doubts = await _doubts(live, session)
        whose = _are_there(live)
        total = await session.scalar(select(func.count()).select_from(SoundingRow).where(*whose))
        depth = case((SoundingRow.sd_m > 0, SoundingRow.depth_m), else_=SoundingRow.raw_depth_m)
        columns = (SoundingRow.id, SoundingRow.lon_deg, SoundingRow.lat_deg, depth)
        query = select(*columns, SoundingRow.verdict, SoundingRow.ruling, SoundingRow.vehicle)
        rows = (
            await session.execute(query.where(*whose, SoundingRow.id > after).order_by(SoundingRow.id).limit(limit + 1))
        ).all()
    shown = rows[:limit]
    states, vehicles = list(SoundingState), sorted({row.vehicle for row in shown})
    place = {name: k for k, name in enumerate(vehicles)}
    return SoundingPoints(
        total=total or 0,
        id=[row.id for row in shown],
        lon_deg=[row.lon_deg for row in shown],
        lat_deg=[row.lat_deg for row in shown],
        depth_m=[row[3] for row in shown],
        state=[states.index(_state(row.id, row.verdict, row.ruling, doubts)) for row in shown],
        vehicle=[place[row.vehicle] for row in shown],
        states=states,
        vehicles=vehicles,
        next_after=shown[-1].id if len(rows) > limit else None,
    )


async def _store(live: LiveMission, sounding_id: int, ruling: Ruling, note: str, actor: str) -> EventRow | None:
    """Write verdict and log line down together; None when it was so already."""
    async with live.database.writing() as session:
        row = await session.get(SoundingRow, sounding_id)
        if row is None or row.mission_id != live.id:
            raise SoundingNotFoundError(
                f"there is no sounding {sounding_id} in this mission", "GET /api/v1/missions/{id}/soundings lists them"
            )
        if row.ruling == ruling:
            return None
        was_accepted = row.verdict == Verdict.ACCEPTED
        before = row.reason or (await _doubts(live, session)).get(row.id, "")
        said = f": {note}" if note else ""
        _decide(live, row, ruling, f"{ruling} by {actor}{said}", before)
        words = f"sounding {row.id} of {row.vehicle}, {row.depth_m:.2f} m, {ruling} by {actor}{said}"
        line = live.journal.line(
            Level.INFO, "sounding", words, sounding=row.id, ruling=str(ruling), actor=actor, note=note, before=before
        )
        session.add(line)
        await session.flush()
        await stored_maps.forget(session, live.id)
    # To count all of them again takes seconds where there are millions.
    counts, more = live.counts, int(row.verdict == Verdict.ACCEPTED) - int(was_accepted)
    live.recount(counts.of_soundings(counts.accepted + more, counts.rejected - more))
    return line


def _correct(live: LiveMission, row: SoundingRow) -> None:
    """Give a sounding its place and depth: one that was refused for a value has none yet. Raises ConflictError."""
    report = report_of(row)
    if row.sd_m == 0:
        row.sd_m = live.gate.deviation_m(report.range_m)
        report = report_of(row)
    why = implausible_value(report)
    found = None if why else live.gate.corrections.apply([report])[0]
    if found is None or found.reason:
        why = why or (found.reason if found is not None else "")
        raise ConflictError(f"sounding {row.id} cannot be restored, {NO_DEPTH}: {why}", COVER_IT)
    row.east_m, row.north_m, row.depth_m, row.level_m = found.east_m, found.north_m, found.depth_m, found.level_m


async def _doubts(live: LiveMission, session: AsyncSession) -> Doubts:
    doubted = live.builder.doubted()
    if not doubted:
        return {}
    found = await sounding_queries.ids_at(session, live.id, [row for row, _ in doubted])
    return {number: reason for ids, (_, reason) in zip(found, doubted, strict=True) for number in ids}


def _condition(state: SoundingState, doubts: Doubts) -> ColumnElement[bool]:
    match state:
        case SoundingState.RESTORED:
            return and_(SoundingRow.ruling == Ruling.RESTORED, SoundingRow.verdict == Verdict.ACCEPTED)
        case SoundingState.WITHDRAWN:
            return SoundingRow.ruling == Ruling.REJECTED
        case SoundingState.REJECTED:
            return and_(SoundingRow.verdict == Verdict.REJECTED, SoundingRow.ruling.is_distinct_from(Ruling.REJECTED))
        case SoundingState.DOUBTED:
            return and_(SoundingRow.id.in_(doubts), SoundingRow.ruling.is_(None))
        case SoundingState.USED:
            used = and_(SoundingRow.verdict == Verdict.ACCEPTED, SoundingRow.ruling.is_(None))
            return and_(used, SoundingRow.id.not_in(doubts))


def _state(number: int, verdict: str, ruling: str | None, doubts: Doubts) -> SoundingState:
    if verdict == Verdict.REJECTED:
        return SoundingState.WITHDRAWN if ruling == Ruling.REJECTED else SoundingState.REJECTED
    if ruling == Ruling.RESTORED:
        return SoundingState.RESTORED
    return SoundingState.DOUBTED if number in doubts else SoundingState.USED


def _view(row: SoundingRow, doubts: Doubts) -> SoundingView:
    state = _state(row.id, row.verdict, row.ruling, doubts)
    corrected = row.sd_m > 0
    return SoundingView(
        id=row.id,
        vehicle=row.vehicle,
        time_s=row.time_s,
        beam=row.beam,
        step=row.step,
        lat_deg=row.lat_deg,
        lon_deg=row.lon_deg,
        range_m=row.range_m,
        raw_depth_m=row.raw_depth_m,
        depth_m=row.depth_m if corrected else None,
        sd_m=row.sd_m if corrected else None,
        state=state,
        reason=doubts.get(row.id, "") if state is SoundingState.DOUBTED else row.reason,
    )
