"""What all of a survey takes, whatever its budget: until nothing is left to ensonify, or all lines are flown."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.missions.forecast.ranges import WAY_SD, ForecastRange, range_of, with_unforeseen
from app.missions.recovery.berths import home_of
from app.missions.recovery.energy import Energy
from app.missions.recovery.failsafes import with_reserve_s
from app.missions.recovery.way_home import WaysHome
from app.missions.spec.mission import MissionSpec
from app.missions.team import Member
from app.missions.views.base import View

HALVINGS = 24
"""How often a way is halved to find where a vehicle has to turn back."""

LEAST_M = 1.0
"""Who comes no farther on a battery than this never comes to the end."""

MOST_BATTERIES = 1000


class WholeVehicleView(View):
    """What one vehicle does in all of a survey."""

    vehicle: str
    distance_m: float = Field(description="Its way, turns included where they were flown; median over the floors")
    distance_m_range: ForecastRange
    duration_s: float = Field(description="Seconds of its time for that, ways to fetch batteries included; median")
    batteries: int | None = Field(
        description="How many full batteries that takes, on the floor that takes most: one more than it has to come "
        "back for another; null: it is not known how long one lasts, or its way home and out is too long for one"
    )


class WholeSurveyView(View):
    """What it takes until nothing is left to ensonify or all lines are flown, whatever the budget is."""

    duration_s: float = Field(description="Until the last vehicle is done, by the vehicles' time; median")
    duration_s_range: ForecastRange
    distance_m: float = Field(description="Of all vehicles together; median")
    distance_m_range: ForecastRange
    vehicles: list[WholeVehicleView]
    within_budget: bool = Field(description="Whether the mission's budget lasts for it on every floor")


@dataclass(frozen=True)
class WholeWay:
    """One vehicle's part in one flight of all of a survey: metres, seconds, and how many batteries it takes."""

    distance_m: float
    seconds: float
    batteries: int | None


@dataclass(frozen=True)
class Batteries:
    """What changing them takes: how many there are, and the seconds on ways home and out again."""

    count: int
    extra_s: float


def whole_way(
    spec: MissionSpec,
    constraints: Constraints,
    member: Member,
    way_m: FloatArray,
    clock_s: FloatArray,
    distance_m: float,
    drawn_out: float = 1.0,
) -> WholeWay:
    """Return what one vehicle does that comes to places (k, 2) at times (k,).

    ``drawn_out``: how many times as much the whole is.
    """
    seconds = float(clock_s[-1]) * drawn_out
    full_s = full_battery_s(spec, member)
    if full_s is None:
        return WholeWay(distance_m * drawn_out, seconds, None)
    home_m = home_of(member.spec, member.slot, spec, spec.vehicles)
    ways_home = None if home_m is None else WaysHome(constraints, home_m)
    speed_mps = spec.speed_of(member.spec)

    def home_s(at_s: float) -> float:
        if ways_home is None:
            return 0.0
        place = np.array([float(np.interp(at_s / drawn_out, clock_s, way_m[:, k])) for k in (0, 1)])
        way = ways_home.way(place)
        return 0.0 if way is None else float(np.hypot(*np.diff(np.vstack([place, way]), axis=0).T).sum()) / speed_mps

    found = batteries(seconds, home_s, full_s, reserved=ways_home is not None)
    extra_s = 0.0 if found is None else found.extra_s
    return WholeWay(distance_m * drawn_out, seconds + extra_s, None if found is None else found.count)


def batteries(
    seconds: float, home_s: Callable[[float], float], full_s: float, *, reserved: bool = True
) -> Batteries | None:
    """Return how many batteries a way of so many seconds takes; None where one does not last for the way out and back.

    Parameters
    ----------
    home_s
        How long the way home is after so many seconds of the way.
    full_s
        How long a full battery lasts for sure.
    reserved
        Whether its vehicle comes home, and keeps a reserve for that.
    """
    at_s, out_s, extra_s = 0.0, 0.0, 0.0

    def lasts(until_s: float) -> bool:
        needs_s = out_s + until_s - at_s + (with_reserve_s(home_s(until_s)) if reserved else 0.0)
        return needs_s <= full_s

    for count in range(1, MOST_BATTERIES):
        if lasts(seconds):
            return Batteries(count, extra_s)
        low, high = at_s, seconds
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if lasts(middle) else (low, middle)
        if low - at_s < LEAST_M:
            return None
        at_s, out_s = low, home_s(low)
        extra_s += 2.0 * out_s
    return None


def full_battery_s(spec: MissionSpec, member: Member) -> float | None:
    """Return how long a vehicle's full battery lasts for sure, by its stated endurance; None: not stated."""
    if member.spec.endurance_min is None:
        return None
    left = Energy(spec.speed_of(member.spec), 60.0 * member.spec.endurance_min).left
    return None if left is None else left.safe_s


def whole_view(flights: list[dict[str, WholeWay]], *, within_budget: bool) -> WholeSurveyView:
    """Return what flights over several floors came to, by vehicles' names."""
    names = list(flights[0])
    counts = {name: [flight[name].batteries for flight in flights] for name in names}
    durations = with_unforeseen([max(way.seconds for way in flight.values()) for flight in flights], WAY_SD)
    distances = with_unforeseen([sum(way.distance_m for way in flight.values()) for flight in flights], WAY_SD)
    vehicles = []
    for name in names:
        known = [count for count in counts[name] if count is not None]
        ways_m = with_unforeseen([flight[name].distance_m for flight in flights], WAY_SD)
        vehicles.append(
            WholeVehicleView(
                vehicle=name,
                distance_m=float(np.median(ways_m)),
                distance_m_range=range_of(ways_m),
                duration_s=float(np.median([flight[name].seconds for flight in flights])),
                batteries=max(known) if len(known) == len(flights) else None,
            )
        )
    return WholeSurveyView(
        duration_s=float(np.median(durations)),
        duration_s_range=range_of(durations),
        distance_m=float(np.median(distances)),
        distance_m_range=range_of(distances),
        vehicles=vehicles,
        within_budget=within_budget,
    )
