"""Sound speed casts that vehicles measured on their way, as they sent them and as their logs tell."""

import math
from collections import defaultdict
from collections.abc import Sequence
from datetime import datetime
from typing import Any

import numpy as np

from app.mapping.water.measured_casts import MeasuredCast, SoundSpeedSamples, measured_casts
from app.missions.large_batches import made_of
from app.missions.live.mission import LiveMission
from app.missions.views.measurements.corrections import VehicleCastView
from app.missions.views.measurements.measured_casts import shown_casts
from app.storage.queries import events as event_queries
from app.storage.queries import sound_speeds as sound_speed_queries


async def vehicles_casts(
    live: LiveMission,
    *,
    vehicle: str | None = None,
    from_s: float | None = None,
    until_s: float | None = None,
) -> list[VehicleCastView]:
    """Return the casts that vehicles measured, in the order of their times.

    What a vehicle sent is left out where its log, which has more of it, was imported and not taken back.

    Parameters
    ----------
    vehicle
        Whose; None: of all.
    from_s, until_s
        Casts are made of what was measured between these times, Unix seconds of the vehicle's clock; those of logs are
        made already, and are returned where they lie between. None: no bound.
    """
    await live.journal.flush()
    await live.sound_speeds.flush()
    async with live.database.reading() as session:
        events = await event_queries.events_of_kind(session, live.id, "import")
        rows = await sound_speed_queries.samples(session, live.id, vehicle=vehicle, first_s=from_s, last_s=until_s)
    logs = [row.data for row in events if row.data.get("casts") and row.data.get("log") not in live.pings.taken_back]
    found: dict[tuple[str, datetime], VehicleCastView] = {}
    for log in logs:
        for cast in log["casts"]:
            view = VehicleCastView(vehicle=log["vehicle"], file=log["file"], **cast)
            within = (from_s or 0.0) <= view.time.timestamp() <= (math.inf if until_s is None else until_s)
            if within and vehicle in (None, view.vehicle):
                # A log that was sent again tells the same.
                found[view.vehicle, view.time] = view
    for view in await made_of(rows, _sent_casts, rows):
        if not any(log["vehicle"] == view.vehicle and _covers(log, view.time) for log in logs):
            found[view.vehicle, view.time] = view
    return sorted(found.values(), key=lambda view: view.time)


def _sent_casts(rows: Sequence[Any]) -> list[VehicleCastView]:
    """Return the casts in what vehicles sent, of each the probe that measured most."""
    probes: dict[str, dict[str, list[tuple[float, ...]]]] = defaultdict(lambda: defaultdict(list))
    for name, probe, *values in rows:
        probes[name][probe].append(tuple(values))
    found = []
    for name, by_probe in probes.items():
        probe = max(by_probe, key=lambda one: len(by_probe[one]))
        casts: list[MeasuredCast] = measured_casts(SoundSpeedSamples(*np.array(by_probe[probe], dtype=float).T))
        found += [VehicleCastView(vehicle=name, probe=probe, **cast.model_dump()) for cast in shown_casts(casts)]
    return found


def _covers(log: dict[str, Any], moment: datetime) -> bool:
    first_s, last_s = log.get("first_s"), log.get("last_s")
    return first_s is not None and last_s is not None and first_s <= moment.timestamp() <= last_s
