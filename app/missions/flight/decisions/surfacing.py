"""Who comes up for a fix: by how well it knows where it is, or by the clock."""

import math

import numpy as np

from app.exploration.core.errands import due_to_rise
from app.exploration.core.moving_targets import Localization
from app.missions.flight.decisions.leg import Place
from app.missions.spec.surface_policy import SurfacePolicy

RISE_AT = 0.9
"""Part of the allowed deviation at which a vehicle comes up: the rest is for the way to the surface."""


def surfacing(team: list[Place], policy: SurfacePolicy | None) -> tuple[list[bool], dict[str, str]]:
    """Return which vehicles come up or stay up for a fix, and what is to be said of those that begin or end it.

    A vehicle that does not say how well it knows where it is comes up by the clock only.
    """
    if policy is None:
        return [False] * len(team), {}
    sd = np.array([place.position_sd_m for place in team])
    limit_m = math.inf if policy.max_position_sd_m is None else policy.max_position_sd_m
    every_s = math.inf if policy.every_min is None else 60.0 * policy.every_min
    due = due_to_rise(Localization(sd, sd / RISE_AT, limit_m))
    up: list[bool] = []
    told: dict[str, str] = {}
    for place, late in zip(team, due, strict=True):
        if not place.moving:
            up.append(False)
            continue
        by_clock = place.submerged_s >= every_s
        # Who says no more how well it knows where it is stays up, unless the clock sees to that.
        says = math.isfinite(place.position_sd_m) or policy.every_min is None
        poor = policy.max_position_sd_m is not None and says and not place.position_sd_m <= policy.until_sd_m
        stays = place.surfacing and (by_clock or poor)
        up.append(bool(late or by_clock or stays))
        if by_clock and not late and not place.surfacing:
            told[place.vehicle] = (
                f"{place.vehicle} comes up for a fix: it was under water for {place.submerged_s / 60:.0f} min"
            )
        elif up[-1] and not place.surfacing:
            told[place.vehicle] = (
                f"{place.vehicle} comes up for a fix: it knows its position to {place.position_sd_m:.2g} m, "
                f"{policy.max_position_sd_m:g} m are allowed"
            )
        elif place.surfacing and not up[-1]:
            knows = f": it knows its position to {place.position_sd_m:.2g} m"
            told[place.vehicle] = (
                f"{place.vehicle} goes down again{knows if math.isfinite(place.position_sd_m) else ''}"
            )
    return up, told
