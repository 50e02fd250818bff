"""What a mission did, step by step, for replay and charts."""

from app.missions.errors import MapNotReadyError
from app.missions.live.mission import LiveMission
from app.missions.live.sounding_store import accepted
from app.missions.maps.builder import BuiltMap
from app.missions.maps.snapshot import MapSnapshot
from app.missions.views.mission import StepView, WaypointView
from app.storage import missions as mission_queries


async def steps_after(live: LiveMission, after: int, limit: int) -> list[StepView]:
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


async def map_at_step(live: LiveMission, step: int) -> MapSnapshot:
    """Return the map that the soundings until the end of a step make. Raises MapNotReadyError without any."""
    if live.builder.newest is None or live.builder.stale or live.builder.arrivals.at_rest:
        await live.build_map()
    found = await accepted(live.database, live.id, 0, until_step=step)
    newest = live.builder.newest
    if newest is None:
        raise MapNotReadyError("no sounding was accepted, so there is no map", "choose a later step")
    try:
        bathymetry = await live.in_thread(live.builder.as_of, found.table)
    except ValueError:
        raise MapNotReadyError(
            f"no sounding was accepted until the end of step {step}", "choose a later step"
        ) from None
    built = BuiltMap(newest.version, len(found.table), bathymetry, newest.digest)
    return MapSnapshot(live.facts, built, step, live.reference_m, live.revision)
