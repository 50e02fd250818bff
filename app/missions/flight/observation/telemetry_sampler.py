"""Writes down, thinly, what vehicles tell of themselves while their mission runs."""

import asyncio

from app.missions.clock import now
from app.missions.live.mission import LiveMission
from app.missions.views.telemetry import VehicleSample

PERIOD_S = 5.0
"""Between samples, in the vehicles' time."""
LEAST_PERIOD_S = 0.5
"""On the wall clock, however fast simulated vehicles live."""


async def keep_telemetry(live: LiveMission, time_scale: float) -> None:
    """Keep samples of vehicles for charts, until cancelled."""
    while True:
        live.journal.telemetry(samples_of(live))
        await asyncio.sleep(max(LEAST_PERIOD_S, PERIOD_S / time_scale))


def samples_of(live: LiveMission) -> list[VehicleSample]:
    """Return the vehicles that were heard, as they are now."""
    at_s = now().timestamp()
    return [
        VehicleSample(view.name, at_s, view.depth_m, view.altitude_m, view.battery_pct, view.age_s)
        for view in live.vehicles.all()
        if view.active and view.age_s is not None
    ]
