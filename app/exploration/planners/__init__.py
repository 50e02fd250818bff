"""The planners by name. Adding one: a class derived from PlannerBase in its own file, and its name in ``PLANNERS``."""

import numpy as np

from app.estimation import RangeSensor, Sensor, SingleBeam
from app.exploration.constraints import Constraints
from app.exploration.options import PlannerOptions
from app.exploration.planners.base import PlannerBase
from app.exploration.planners.cao import CaoPlanner
from app.exploration.planners.formation import FormationLawnmower
from app.exploration.planners.gradient import FdsaPlanner, SpsaPlanner
from app.exploration.planners.lawnmower import LawnmowerPlanner
from app.exploration.planners.random_walk import RandomPlanner
from app.exploration.planners.rollout import RolloutPlanner
from app.exploration.problem import Belief, Situation

PLANNERS: dict[str, type[PlannerBase]] = {
    planner.name: planner
    for planner in (CaoPlanner, LawnmowerPlanner, RandomPlanner, RolloutPlanner, SpsaPlanner, FdsaPlanner)
}

ONLY_IN_SIMULATION = ("osarses", "spsa-tried", "fdsa-tried")
"""Yardsticks that really try their moves and take them back, as only ``bathyfleet evaluate explore`` can."""

REFUSAL = "{name} really tries its moves before it takes one, which only bathyfleet evaluate explore can simulate"


def create_planner(
    name: str = "cao",
    options: PlannerOptions = PlannerOptions(),  # noqa: B008 - frozen
    sensor: Sensor = SingleBeam(),  # noqa: B008 - frozen
) -> PlannerBase:
    """Return a new planner.

    Parameters
    ----------
    name : str
        One of ``PLANNERS``. A lawnmower with landmark sensors flies as one formation. ``rollout`` with a bathymeter
        is ``cao``: its survey regressors are a plan of the whole mission already.
    options : PlannerOptions
        Its settings.
    sensor : RangeSensor or SingleBeam
        What the vehicles measure: landmarks within sight, or the bottom right below them all along the way.

    Raises
    ------
    ValueError
        When there is no planner of that name.
    """
    if name in ONLY_IN_SIMULATION:
        raise ValueError(f"planner: {REFUSAL.format(name=name)}")
    try:
        planner = PLANNERS[name]
    except KeyError:
        raise ValueError(f"planner: there is no {name!r}; choose one of {', '.join(sorted(PLANNERS))}") from None
    if planner is LawnmowerPlanner and isinstance(sensor, RangeSensor):
        return FormationLawnmower(options, sensor)
    if planner is RolloutPlanner and not isinstance(sensor, RangeSensor):
        return CaoPlanner(options, sensor)
    return planner(options, sensor)


def warm_up(*sensors: Sensor) -> None:
    """Compile what the planners need for these sensors (or load it from the cache), so that no step waits for it."""
    area = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]])
    east, north = np.meshgrid(np.arange(2.0, 20.0, 4.0), np.arange(2.0, 20.0, 4.0))
    xy = np.column_stack([east.ravel(), north.ravel()])
    n = len(xy)
    belief = Belief(xy, np.full(n, 9.0), np.ones(n), np.zeros(n, dtype=np.bool_), np.ones(n), 8.0)
    constraints = Constraints(area, (np.array([[12.0, 12.0], [14.0, 12.0], [14.0, 14.0]]),), max_step_m=4.0)
    positions = np.array([[2.0, 2.0, 1.0], [6.0, 2.0, 1.0]])
    situation = Situation(1, 10, ("a", "b"), positions, np.full(2, np.nan), belief, positions[:, :2], constraints)
    for sensor in sensors:
        for name in tuple(PLANNERS):
            create_planner(name, sensor=sensor).propose(situation, np.random.default_rng(0))
