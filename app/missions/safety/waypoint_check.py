"""The last check before anything is sent to a vehicle: every limit of the mission."""

from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints


@dataclass(frozen=True)
class CheckedStep:
    """What may be sent.

    Attributes
    ----------
    positions : (n_vehicles, 3)
        Allowed waypoints; rows of vehicles with a refusal mean nothing.
    refusals : dict
        Vehicles that get no waypoint, with the reason.
    corrections : dict
        Vehicles whose waypoint was changed, with the reason.
    """

    positions: FloatArray
    refusals: dict[str, str]
    corrections: dict[str, str]


def check_step(
    vehicles: tuple[str, ...],
    origin: FloatArray,
    proposed: FloatArray,
    constraints: Constraints,
    bottom: Bottom,
) -> CheckedStep:
    """Return the part of a proposal that breaks no limit.

    A vehicle whose waypoint breaks one holds its place instead; one that cannot even hold gets no waypoint at all.

    Parameters
    ----------
    vehicles
        Names, in the order of the rows.
    origin, proposed : (n_vehicles, 3)
        Where the vehicles are and where the planner wants them.
    bottom : Bottom
        The sea floor as estimated now.
    """
    positions = np.array(proposed, dtype=float)
    corrections: dict[str, str] = {}
    refusals: dict[str, str] = {}
    for i, name in enumerate(vehicles):
        if not np.isfinite(positions[i]).all():
            corrections[name] = f"the planner proposed {positions[i].tolist()}, which is no place; the vehicle holds"
            positions[i] = origin[i]
    # Holding one vehicle can bring it too close to another's waypoint: repeat until nothing changes.
    for _ in range(len(vehicles) + 1):
        broken = {v.vehicle: v.reason for v in constraints.violations(vehicles, origin, positions, bottom)}
        fresh = [name for name in broken if name not in corrections]
        for name in fresh:
            corrections[name] = f"{broken[name]}; the vehicle holds instead"
            positions[vehicles.index(name)] = origin[vehicles.index(name)]
        if not fresh:
            refusals = broken
            break
    return CheckedStep(positions, refusals, {n: r for n, r in corrections.items() if n not in refusals})
