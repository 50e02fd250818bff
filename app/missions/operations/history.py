"""What a mission did: its steps, its log, and what its vehicles told and measured; where it is long, page by page."""

from app.missions.errors import TargetNotFoundError
from app.missions.live.journals.journal import event_view
from app.missions.live.mission import LiveMission
from app.missions.views.measurements.soundings import Verdict
from app.missions.views.mission import EventView, Level, StepView, WaypointView
from app.missions.views.targets import TargetRangePage, TargetRangeView
from app.missions.views.telemetry import TelemetryView, telemetry_view
from app.storage.queries import events as event_queries
from app.storage.queries import missions as mission_queries
from app.storage.queries import target_ranges as range_queries
from app.storage.queries import telemetry as telemetry_queries


async def steps_after(live: LiveMission, after: int = 0, limit: int = 1000) -> list[StepView]:
    """Return up to ``limit`` steps with a number above ``after``, each with its waypoints as they ended."""
    async with live.database.reading() as session:
        steps = await mission_queries.steps_after(session, live.id, after, limit)
        if not steps:
            return []
        rows = await mission_queries.waypoints_between(session, live.id, steps[0].number, steps[-1].number)
    waypoints: dict[int, list[WaypointView]] = {}
    for row in rows:
        waypoints.setdefault(row.step, []).append(live.waypoints.view(row))
    return [
        StepView(
            number=step.number,
            committed_at=step.committed_at,
            objective=step.objective,
            terms=step.terms,
            figures=step.figures or {},
            soundings=step.soundings,
            waypoints=waypoints.get(step.number, []),
        )
        for step in steps
    ]


async def events_after(live: LiveMission, after: int = 0, limit: int = 1000) -> list[EventView]:
    """Return up to ``limit`` lines of the log with an id above ``after``, oldest first."""
    async with live.database.reading() as session:
        rows = await event_queries.events_after(session, live.id, after, limit)
    return [event_view(row) for row in rows]


async def write_note(live: LiveMission, text: str, actor: str) -> EventView:
    """Keep an operator's words in the log."""
    row = live.journal.line(Level.INFO, "note", text, actor=actor)
    await live.journal.write(row)
    return event_view(row)


async def telemetry_of(live: LiveMission, points: int) -> TelemetryView:
    """Return what the vehicles told of themselves, at about ``points`` moments at most."""
    await live.journal.flush()
    async with live.database.reading() as session:
        rows = await telemetry_queries.samples(session, live.id, points)
    return telemetry_view(rows)


async def target_ranges_page(
    live: LiveMission, target: str | None = None, after: int = 0, limit: int = 200
) -> TargetRangePage:
    """Return a page of the ranges. Raises TargetNotFoundError for a target that the mission does not have."""
    names = list(live.ranges.tracking.specs)
    if target is not None and target not in names:
        there = ", ".join(names) or "it has none"
        raise TargetNotFoundError(f"{target!r} is not a target of this mission", f"Those that are: {there}")
    await live.ranges.flush()
    async with live.database.reading() as session:
        rows = await range_queries.ranges_after(session, live.id, after, limit + 1, target)
    items = [
        TargetRangeView(
            id=row.id,
            target=row.target,
            vehicle=row.vehicle,
            time_s=row.time_s,
            received_at=row.received_at,
            step=row.step,
            source=row.source,
            range_m=row.range_m,
            lat_deg=row.lat_deg,
            lon_deg=row.lon_deg,
            depth_m=row.depth_m,
            used=row.verdict == Verdict.ACCEPTED,
            reason=row.reason,
        )
        for row in rows[:limit]
    ]
    return TargetRangePage(items=items, next_after=items[-1].id if len(rows) > limit else None)
