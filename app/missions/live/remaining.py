"""What is left of a mission's length, in an operator's units."""

from dataclasses import dataclass

from app.missions.spec.mission import MissionSpec
from app.missions.team import Member, Team
from app.missions.views.search import SearchProgress


@dataclass(frozen=True)
class Remaining:
    """What is left to fly for the vehicle with most; None where that is not known."""

    minutes: float | None
    km_per_vehicle: float | None


def remaining(spec: MissionSpec, team: Team) -> Remaining:
    """Return what is left of a mission; vehicles of which that is not known yet have all that their budget allows.

    What a vehicle leaves that was called home counts only when nobody goes on, and of these the ones that surveyed,
    if any did.
    """
    minutes, metres = [], []
    for member in team.going_on or [member for member in team if member.flown.surveyed] or team:
        left = _left_of(spec, member)
        if left is not None:
            minutes.append(left[0])
            metres.append(left[1])
    return Remaining(round(max(minutes), 2), round(max(metres) / 1000, 3)) if metres else Remaining(None, None)


def left_words(spec: MissionSpec, team: Team) -> str:
    """Return how much of a mission's length is left, as words after a reason; '' where it is counted in steps.

    Of several vehicles it is told of each, and who of them never surveyed.
    """
    if spec.budget.minutes is None and spec.budget.km_per_vehicle is None:
        return ""
    members = team.going_on or list(team)
    told = {m.name: _words(spec, m) if m.flown.surveyed or len(members) == 1 else "never surveyed" for m in members}
    if len(members) == 1:
        return "".join(f", {words}" for words in told.values() if words)
    words = "; ".join(f"{name} {what}" for name, what in told.items() if what)
    return f": {words}" if words else ""


def _words(spec: MissionSpec, member: Member) -> str:
    """Return how much a vehicle leaves of its length; '' where that is nothing, or not known."""
    minutes, metres = _left_of(spec, member) or (0.0, 0.0)
    if spec.budget.minutes is not None:
        return f"{minutes:.0f} min before its time was up" if round(minutes, 2) else ""
    return f"{metres / 1000:.1f} km before it had flown its way" if round(metres) else ""


def _left_of(spec: MissionSpec, member: Member) -> tuple[float, float] | None:
    """Return the minutes and metres that a vehicle may fly yet; None where that is not known."""
    left_m = spec.allowance(member.spec).metres if member.flown.left_m is None else member.flown.left_m
    return None if left_m is None else (left_m / spec.speed_of(member.spec) / 60.0, left_m)


def within_window(search: SearchProgress) -> Remaining:
    """Return what is left of a search: its time window's rest, whatever number of steps it may take."""
    return Remaining(round(max(search.left_s, 0.0) / 60.0, 2), None)
