"""What is left of a mission's length, in an operator's units."""

from dataclasses import dataclass, replace

from app.missions.flown import Flown
from app.missions.spec.mission import MissionSpec
from app.missions.team import Member, Team


@dataclass(frozen=True)
class Remaining:
    """What is left to fly for the vehicle with most; None where that is not known."""

    minutes: float | None
    km_per_vehicle: float | None


def remaining(spec: MissionSpec, team: Team) -> Remaining:
    """Return what is left of a mission; vehicles of which that is not known yet have all that their budget allows."""
    parts = [(_with_left(spec, member), spec.speed_of(member.spec)) for member in team]
    minutes = [left for flown, speed in parts if (left := flown.minutes_left(speed)) is not None]
    metres = [flown.left_m for flown, _ in parts if flown.left_m is not None]
    return Remaining(round(max(minutes), 2), round(max(metres) / 1000, 3)) if metres else Remaining(None, None)


def _with_left(spec: MissionSpec, member: Member) -> Flown:
    known = member.flown
    return known if known.left_m is not None else replace(known, left_m=spec.allowance(member.spec).metres)
