"""Ranges to targets, page by page."""

from app.missions.errors import TargetNotFoundError
from app.missions.live.mission import LiveMission
from app.missions.views.soundings import Verdict
from app.missions.views.targets import TargetRangePage, TargetRangeView
from app.storage import target_ranges as range_queries


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
