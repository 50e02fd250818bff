"""What is left of a mission's length, in an operator's units."""

from dataclasses import dataclass

from app.missions.spec.mission import MissionSpec
from app.missions.team import Team
from app.missions.views.search import SearchProgress


@dataclass(frozen=True)
class Remaining:
    """What is left to fly for the vehicle with most; None where that is not known."""

    minutes: float | None
    km_per_vehicle: float | None


def remaining(spec: MissionSpec, team: Team) -> Remaining:
    """Return what is left of a mission; vehicles of which that is not known yet have all that their budget allows.

    What a vehicle leaves that was called home counts only when nobody goes on.
    """
    minutes, metres = [], []
    for member in team.going_on or team:
        left_m = spec.allowance(member.spec).metres if member.flown.left_m is None else member.flown.left_m
        if left_m is not None:
            minutes.append(left_m / spec.speed_of(member.spec) / 60.0)
            metres.append(left_m)
    return Remaining(round(max(minutes), 2), round(max(metres) / 1000, 3)) if metres else Remaining(None, None)


def within_window(search: SearchProgress) -> Remaining:
    """Return what is left of a search: its time window's rest, whatever number of steps it may take."""
    return Remaining(round(max(search.left_s, 0.0) / 60.0, 2), None)
