"""What vehicles told of themselves while a mission ran, for charts of the past."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import Field

from app.missions.views.base import View


@dataclass(frozen=True, slots=True)
class VehicleSample:
    """One vehicle at one moment. ``at_s``: Unix seconds by our clock; ``age_s``: since it was heard."""

    vehicle: str
    at_s: float
    depth_m: float | None
    altitude_m: float | None
    battery_pct: float | None
    age_s: float | None


class VehicleTelemetry(View):
    """One vehicle's figures, a value or null for each of the moments."""

    vehicle: str
    depth_m: list[float | None]
    altitude_m: list[float | None]
    battery_pct: list[float | None]
    age_s: list[float | None] = Field(description="Seconds since it was heard")


class TelemetryView(View):
    """What the vehicles told of themselves while the mission ran."""

    times_s: list[float] = Field(description="The moments, Unix seconds by the service's clock, ascending")
    vehicles: list[VehicleTelemetry]


FIGURES = ("depth_m", "altitude_m", "battery_pct", "age_s")


def telemetry_view(rows: Sequence[Any]) -> TelemetryView:
    """Return samples, ordered by time, as columns over the moments that any vehicle has."""
    moments = {at_s: number for number, at_s in enumerate(dict.fromkeys(row.at_s for row in rows))}
    columns: dict[str, dict[str, list[float | None]]] = {}
    for row in rows:
        of = columns.setdefault(row.vehicle, {name: [None] * len(moments) for name in FIGURES})
        for name in FIGURES:
            of[name][moments[row.at_s]] = getattr(row, name)
    return TelemetryView(
        times_s=list(moments),
        vehicles=[VehicleTelemetry(vehicle=vehicle, **columns[vehicle]) for vehicle in sorted(columns)],
    )
