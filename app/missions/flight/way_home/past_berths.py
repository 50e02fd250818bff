"""Ways home past the berths of others: below who waits there, or round it where the water is too shallow for that."""

from collections.abc import Iterator

from app.arrays import FloatArray
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.live.mission import LiveMission
from app.missions.recovery.berths import home_of
from app.missions.recovery.way_home import passed_over
from app.missions.team import Member

CLEAR = 1.2
"""Ways that lead round a berth keep this many times the least separation off it."""


def way_past_berths(
    member: Member, here_m: FloatArray, home_m: FloatArray, live: LiveMission, energy_range: EnergyRange
) -> list[tuple[FloatArray, float]] | None:
    """Return the corners (2,) of a vehicle's way home, and how deep it travels to each; None: there is no way.

    Parameters
    ----------
    here_m, home_m : (2,)
        Where it is, and its own berth.
    """
    limits = live.spec.limits
    berths_m = list(_taken(member, live)) if limits.min_separation_m > 0.0 else []
    past_m: list[FloatArray] = []
    way_m, round_m = None, energy_range.way_from(here_m, home_m)
    while round_m is not None:
        way_m, depths_m = round_m, energy_range.depths_m(member, here_m, round_m)
        met_m = [
            place_m
            for place_m in berths_m
            if passed_over(here_m, way_m, depths_m, place_m, limits.min_separation_m, limits.min_vertical_separation_m)
        ]
        berths_m = [place_m for place_m in berths_m if not any(place_m is met for met in met_m)]
        past_m += met_m
        round_m = energy_range.way_past(here_m, home_m, past_m, CLEAR * limits.min_separation_m) if met_m else None
    return None if way_m is None else list(zip(way_m, depths_m, strict=True))


def _taken(member: Member, live: LiveMission) -> Iterator[FloatArray]:
    """Yield where others wait to be taken out of the water, or will, each (2,)."""
    at_rest = {other.name for other in live.team.at_rest}
    for other in live.team:
        if other is member:
            continue
        lies = other.name in at_rest
        place_m = other.place_m(live.frame) if lies else home_of(other.spec, other.slot, live.spec, live.team.specs)
        if place_m is not None:
            yield place_m
