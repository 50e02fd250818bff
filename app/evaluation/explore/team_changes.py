"""Vehicles that are lost and vehicles that join during a run."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints, inside_area

NEAREST, FARTHEST = 0.5, 0.8
"""How far from a team member a newcomer is launched, as a fraction of the communication range."""

SHRINK = 0.8
DRAWS_PER_SHRINK = 100
DRAWS = 3000


@dataclass(frozen=True)
class TeamSchedule:
    """Which vehicles leave and how many join, and when; vehicles are numbered from 1 in the order of their joining.

    Attributes
    ----------
    lost : tuple of (number, step)
        The vehicle vanishes when the step begins: it takes no part in its decision.
    joining : tuple of (count, step)
        So many vehicles more when the step begins, after the losses of that step.
    """

    lost: tuple[tuple[int, int], ...] = ()
    joining: tuple[tuple[int, int], ...] = ()

    def lost_at(self, step: int) -> set[int]:
        """Return the numbers of the vehicles that vanish when the step begins."""
        return {number for number, when in self.lost if when == step}

    def joining_at(self, step: int) -> int:
        """Return how many vehicles join when the step begins."""
        return sum(count for count, when in self.joining if when == step)

    def check(self, robots: int, steps: int) -> None:
        """Raise ValueError, saying what would be right, when a change is not possible in a run."""
        for what, changes in (("lose", self.lost), ("join", self.joining)):
            for amount, step in changes:
                if not 1 <= step <= steps:
                    raise ValueError(f"{what} {amount}@{step}: the run has steps 1 to {steps}")
                if amount < 1:
                    raise ValueError(f"{what} {amount}@{step}: the number before the @ must be at least 1")
        team, joined = set(range(1, robots + 1)), robots
        for step in sorted({when for _, when in (*self.lost, *self.joining)}):
            for number in [number for number, when in self.lost if when == step]:
                if number not in team:
                    there = ", ".join(map(str, sorted(team)))
                    raise ValueError(f"lose {number}@{step}: there is no vehicle {number} then; there are {there}")
                team.remove(number)
            if not team:
                raise ValueError(f"lose at step {step}: no vehicle would be left; at least one must stay")
            count = self.joining_at(step)
            team |= set(range(joined + 1, joined + count + 1))
            joined += count


def parse_changes(text: str | None) -> tuple[tuple[int, int], ...]:
    """Return the pairs of ``K@T,K@T``; none for None. Raises ValueError when it is not that."""
    if text is None:
        return ()
    pairs = []
    for part in text.split(","):
        before, _, after = part.partition("@")
        try:
            pairs.append((int(before), int(after)))
        except ValueError:
            raise ValueError(f"{part.strip()!r} is not K@T, like 2@50; several are separated by commas") from None
    return tuple(pairs)


def launch_site(
    team: FloatArray,
    heights: FloatArray,
    constraints: Constraints,
    depth_at: Callable[[FloatArray], FloatArray],
    rng: np.random.Generator,
) -> FloatArray:
    """Return where a newcomer is launched, (3,): near a team member drawn at random, as high above the floor as it.

    Parameters
    ----------
    team : (n_vehicles, 3)
        The vehicles already there.
    heights : (n_vehicles,)
        How high each is above the true floor.
    constraints : Constraints
        Give area, zones and communication range; with an unlimited one the area's size stands for the range.
    depth_at : callable
        True depth at positions (n, 2).
    """
    member = int(rng.integers(len(team)))
    reach = constraints.com_range_m if np.isfinite(constraints.com_range_m) else float(np.ptp(constraints.area))
    for draw in range(DRAWS):
        # Closer and closer: the member may be in a narrow place or on a steep slope.
        distance = rng.uniform(NEAREST, FARTHEST) * reach * SHRINK ** (draw // DRAWS_PER_SHRINK)
        bearing = rng.uniform(0.0, 2.0 * np.pi)
        en = team[member, :2] + distance * np.array([np.sin(bearing), np.cos(bearing)])
        site = np.append(en, depth_at(en[None])[0] - heights[member])
        if not inside_area(constraints, en[None])[0] or not np.isfinite(site[2]):
            continue
        if constraints.min_depth_m <= site[2] and np.linalg.norm(site - team[member]) <= FARTHEST * reach:
            return site
    return np.array(team[member])
