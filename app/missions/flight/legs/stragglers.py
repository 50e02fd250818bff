"""Vehicles that take longer for a leg than they may: how long that is, and what the log says of them.

A vehicle on its own legs goes on with the next one (:mod:`app.missions.flight.legs.dispatch`); a team in steps goes on
without it (:mod:`app.missions.flight.team_steps`).
"""

import math
from collections.abc import Sequence

import numpy as np

from app.missions.live.mission import LiveMission
from app.missions.spec.vehicle import Guidance
from app.missions.team import Member
from app.missions.views.mission import Level
from imc_bridge.control.plans import leg_time_s

SOUND_S = 60.0
"""What commands and reports take by sound, at the most."""

SLOWEST_SHARE = 0.5
"""Part of the speed asked for that a vehicle may make good on its leg, before it counts as a straggler."""


def leg_allowed_s(live: LiveMission, member: Member) -> float:
    """Return how long a vehicle may take for its leg, by its clock: longer than asked for where that is long."""
    spec, order = live.spec, member.order
    if order is None or member.target_m is None or member.report is None:
        return spec.step_deadline_s
    away_m = float(np.linalg.norm(member.target_m - member.place_m(live.frame)))
    if member.spec.guidance is Guidance.FOLLOW:
        return max(spec.step_deadline_s, away_m / (SLOWEST_SHARE * order.speed_mps))
    by_sound_s = SOUND_S if member.spec.guidance is Guidance.ACOUSTIC else 0.0
    return max(spec.step_deadline_s, leg_time_s(away_m, order.position.depth_m, order.speed_mps) + by_sound_s)


def step_allowed_s(live: LiveMission) -> float:
    """Return how long a team's step may take, by the vehicles' clocks: as long as the longest leg of it may."""
    under_way = [member.leg.allowed_s for member in live.team if member.ordered and member.report is not None]
    return max([live.spec.step_deadline_s, *under_way])


def late_at_s(member: Member, time_scale: float) -> float:
    """Return the event loop's time from which on a vehicle that is still on its leg is a straggler.

    inf while it lets another one pass.
    """
    if member.lets_pass:
        return math.inf
    return member.leg.began_s + member.leg.allowed_s / time_scale


def missed(allowed_s: float) -> str:
    """Say why a straggler's leg is over."""
    return f"not reached within {allowed_s:.0f} s"


async def tell_of(live: LiveMission, late: Sequence[Member], message: str, number: int) -> None:
    """Write into the log who came too late for its leg or step ``number``, and how the mission goes on."""
    await live.journal.log(Level.WARNING, "straggler", message, step=number, vehicles=[member.name for member in late])
