"""Where the uncertainty of a mission's soundings comes from."""

import numpy as np

from app.arrays import FloatArray
from app.estimation.uncertainty import COMPONENTS, BeamPaths, uncertainty
from app.mapping.s44 import Order, max_thu_m, max_tvu_m, thu_m, tvu_m
from app.missions.live.mission import LiveMission
from app.missions.maps.snapshot import MapSnapshot
from app.missions.views.measurements.uncertainty import (
    AllowedView,
    ComponentView,
    ShareView,
    TotalView,
    UncertaintyBudgetView,
)

ANGLES_DEG = (0.0, 45.0, 60.0)

LEAST_BELOW_M = 0.5
"""Vehicles travel at least so far above the bottom."""


def uncertainty_budget(live: LiveMission, snapshot: MapSnapshot) -> UncertaintyBudgetView:
    """Return what each source of error adds straight down and to the sides, at the map's mean depth."""
    return budget_from(snapshot, travel_depth_m(live))


def travel_depth_m(live: LiveMission) -> float:
    """Return how deep the highest vehicle of a mission travels."""
    limits = live.spec.limits
    return min((member.cruise_depth_m(limits) for member in live.team), default=limits.min_depth_m)


def budget_from(snapshot: MapSnapshot, travel_m: float) -> UncertaintyBudgetView:
    """Return the budget of soundings that are made from a depth."""
    spec = snapshot.facts.spec
    depth_m = float(np.nanmean(snapshot.built.map.depth_m))
    below_m = max(depth_m - travel_m, LEAST_BELOW_M)
    count = len(ANGLES_DEG)
    beams = BeamPaths(np.radians(ANGLES_DEG), np.full(count, below_m), np.zeros(count))
    components = [
        _component(name, one.title, one.unit, one.sd(spec.uncertainty), one.down(beams), one.aside(beams))
        for name, one in COMPONENTS.items()
    ]
    level = np.ones(count)
    components.append(_component("tide", "Tide", "m", spec.tide.sd_m, level, 0.0 * level))
    found = uncertainty(beams, spec.uncertainty)
    vertical, horizontal = tvu_m(found.vertical_sd_m, spec.tide.sd_m), thu_m(found.horizontal_sd_m)
    at = np.array(depth_m)
    return UncertaintyBudgetView(
        depth_m=depth_m,
        below_sonar_m=below_m,
        components=components,
        totals=[
            TotalView(angle_deg=angle, tvu_m=tvu, thu_m=thu)
            for angle, tvu, thu in zip(ANGLES_DEG, vertical.tolist(), horizontal.tolist(), strict=True)
        ],
        allowed=[
            AllowedView(order=order, tvu_m=float(max_tvu_m(at, order)), thu_m=float(max_thu_m(at, order)))
            for order in Order
        ],
    )


def _component(name: str, title: str, unit: str, sd: float, down: FloatArray, aside: FloatArray) -> ComponentView:
    shares = zip(ANGLES_DEG, (sd * down).tolist(), (sd * aside).tolist(), strict=True)
    return ComponentView(
        name=name,
        title=title,
        unit=unit,
        sd=sd,
        shares=[ShareView(angle_deg=angle, vertical_m=v, horizontal_m=h) for angle, v, h in shares],
    )
