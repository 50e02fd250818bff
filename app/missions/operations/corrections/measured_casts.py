"""Sound speed casts that vehicles measured on their way, as their logs tell."""

from datetime import datetime

from app.missions.live.mission import LiveMission
from app.missions.views.measurements.corrections import VehicleCastView
from app.storage.queries import events as event_queries


async def vehicles_casts(live: LiveMission) -> list[VehicleCastView]:
    """Return the casts in all logs that were imported and not taken back, in the order of their times."""
    await live.journal.flush()
    async with live.database.reading() as session:
        rows = await event_queries.events_of_kind(session, live.id, "import")
    found: dict[tuple[str, datetime], VehicleCastView] = {}
    for row in rows:
        if row.data.get("log") in live.pings.taken_back:
            continue
        for cast in row.data.get("casts") or []:
            view = VehicleCastView(vehicle=row.data["vehicle"], file=row.data["file"], **cast)
            # A log that was sent again tells the same.
            found[view.vehicle, view.time] = view
    return sorted(found.values(), key=lambda view: view.time)
