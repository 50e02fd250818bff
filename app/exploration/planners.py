"""The planners by name. Adding one: a class derived from PlannerBase in its own file, and its name in ``PLANNERS``.

Those that other packages bring are added to ``PLANNERS`` when this is imported, see :mod:`app.exploration.installed`.
"""

from functools import cache

import numpy as np

from app.estimation import OccupancyGrid, RangeSensor, Scanner, Sensor, SingleBeam
from app.exploration.cao.gradient import FdsaPlanner, SpsaPlanner
from app.exploration.cao.planner import CaoPlanner
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.installed import find_planners
from app.exploration.lines.formation import FormationLawnmower
from app.exploration.lines.lawnmower import LawnmowerPlanner
from app.exploration.pcao.planner import PcaoPlanner
from app.exploration.planner.base import PlannerBase
from app.exploration.planner.options import OF_EVERY_PLANNER, PlannerOptions
from app.exploration.planner.random_walk import RandomPlanner
from app.exploration.rollout.planner import RolloutPlanner
from app.exploration.site_search import SearchTask
from app.exploration.site_search.cao import CaoSearch, SpsaSearch
from app.exploration.site_search.frontier import FrontierSearch
from app.exploration.site_search.random_flights import RandomFlights
from app.exploration.swath.lines import warm_up as warm_up_lines
from app.exploration.swath.planner import SwathPlanner

PLANNERS: dict[str, type[PlannerBase]] = {
    planner.name: planner
    for planner in (CaoPlanner, LawnmowerPlanner, PcaoPlanner, RandomPlanner, RolloutPlanner, SpsaPlanner, FdsaPlanner)
}

COVERERS: dict[str, type[PlannerBase]] = {planner.name: planner for planner in (SwathPlanner,)}
"""The planners of surveys whose vehicles all have swath sonars."""

SEARCHERS: dict[str, type[PlannerBase]] = {
    planner.name: planner for planner in (FrontierSearch, CaoSearch, SpsaSearch, RandomFlights)
}
"""The planners of search missions, by the same names: what is called rollout there goes for the best views."""

ONLY_IN_SIMULATION = ("osarses", "spsa-tried", "fdsa-tried")
"""Yardsticks that really try their moves and take them back, as only ``bathyfleet evaluate explore`` can."""

QUICK = PlannerOptions(search=8, rollouts=8, candidates=4)
"""Enough to run through every part of a planner once."""


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
        is ``cao``: its survey regressors are a plan of the whole mission already. With landmark sensors ``pcao``
        falls back on ``rollout`` where it would not be done in time.
    options : PlannerOptions
        Its settings.
    sensor : RangeSensor or SingleBeam
        What the vehicles measure: landmarks within sight, or the bottom right below them all along the way.

    Raises
    ------
    ValueError
        When there is no planner of that name.
    """
    try:
        planner = (PLANNERS | COVERERS)[name]
    except KeyError:
        there = ", ".join(sorted(PLANNERS | COVERERS))
        raise ValueError(f"planner: {missing(name)}; choose one of {there}") from None
    if isinstance(sensor, Scanner):
        return _searcher(name)(options, sensor)
    if planner is LawnmowerPlanner and isinstance(sensor, RangeSensor):
        return FormationLawnmower(options, sensor)
    if planner is RolloutPlanner and not isinstance(sensor, RangeSensor):
        return CaoPlanner(options, sensor)
    if planner is PcaoPlanner and isinstance(sensor, RangeSensor):
        return PcaoPlanner(options, sensor, fallback=RolloutPlanner(options, sensor))
    return planner(options, sensor)


def options_of(planner: type[PlannerBase]) -> frozenset[str]:
    """Return the options that a planner reads: all of them where its class does not say."""
    # What a planner of another package inherits says nothing about what it reads itself.
    own: frozenset[str] | None = vars(planner).get("own_options")
    return frozenset(PlannerOptions.model_fields) if own is None else own | OF_EVERY_PLANNER


def missing(name: str) -> str:
    """Return why there is no planner of a name: not known, installed and broken, or only a yardstick."""
    if name in ONLY_IN_SIMULATION:
        return f"{name} really tries its moves before it takes one, which only bathyfleet evaluate explore can simulate"
    broken = INSTALLED.broken.get(name)
    return (
        f"there is no planner {name!r}"
        if broken is None
        else f"{name!r} of {broken.package} cannot be used: {broken.reason}"
    )


def _searcher(name: str) -> type[PlannerBase]:
    try:
        return SEARCHERS[name]
    except KeyError:
        there = ", ".join(sorted(SEARCHERS))
        raise ValueError(f"planner: {name!r} does not search; choose one of {there}") from None


def warm_up(*sensors: Sensor) -> None:
    """Compile what every planner needs for these sensors (or load it from the cache), so that no step waits for it."""
    for sensor in sensors:
        for name in SEARCHERS if isinstance(sensor, Scanner) else PLANNERS:
            warm_up_planner(name, sensor)


@cache
def warm_up_planner(name: str, sensor: Sensor) -> None:
    """Compile what one planner needs for a sensor; once in a process is enough: another call does nothing."""
    # A sea floor of a few times the sensor's reach: one that a single step surveys needs the same machine code.
    unit_m = sensor.visibility_m if isinstance(sensor, RangeSensor) else 4.0
    situation = _small_search(sensor) if isinstance(sensor, Scanner) else _small_situation(unit_m)
    if name in COVERERS:
        warm_up_lines()
    create_planner(name, QUICK, sensor).propose(situation, np.random.default_rng(0))


def _small_situation(unit_m: float) -> Situation:
    """Return two vehicles before a flat bottom of 5 by 5 units, with a keep-out zone."""
    area = unit_m * np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 5.0], [0.0, 5.0]])
    east, north = np.meshgrid(unit_m * np.arange(0.5, 5.0), unit_m * np.arange(0.5, 5.0))
    xy = np.column_stack([east.ravel(), north.ravel()])
    n = len(xy)
    belief = Belief(xy, np.full(n, 9.0), np.ones(n), np.zeros(n, dtype=np.bool_), np.ones(n), 8.0)
    zone = unit_m * np.array([[3.0, 3.0], [3.5, 3.0], [3.5, 3.5]])
    constraints = Constraints(area, (zone,), max_step_m=unit_m)
    positions = np.column_stack([unit_m * np.array([[0.5, 0.5], [1.5, 0.5]]), np.ones(2)])
    return Situation(1, 10, ("a", "b"), positions, np.full(2, np.nan), belief, positions[:, :2], constraints)


def _small_search(scanner: Scanner) -> Situation:
    """Return a vehicle that has looked round once, a wall before it."""
    blueprint = np.zeros((30, 30), dtype=np.bool_)
    blueprint[20] = True
    here = np.array([10.5, 10.5, 0.0])
    unit = scanner.reach_m / 8.0
    bearings = scanner.bearings_rad
    grid = OccupancyGrid.from_blueprint(blueprint, unit)
    grid = grid.seen_from(unit * here, bearings, np.full(len(bearings), np.inf), scanner.reach_m)
    goal, entry = unit * np.array([25.0, 25.0]), unit * here[:2]
    task = SearchTask(grid, scanner, goal, 5 * unit, entry, entry, 200 * unit, unit, unit, 90 * unit, 100 * unit)
    area = unit * np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 30.0], [0.0, 30.0]])
    nothing = Belief(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.bool_), np.zeros(0), 1.0)
    return Situation(
        1, 10, ("a",), unit * here[None], np.full(1, np.nan), nothing, np.zeros((0, 2)),
        Constraints(area, max_step_m=10 * unit, min_altitude_m=0.0), search=task,
    )  # fmt: skip


# At the end, so that a planner of another package may import everything from here.
INSTALLED = find_planners({*PLANNERS, *COVERERS, *SEARCHERS, *ONLY_IN_SIMULATION})
"""The planners of other packages, also those that cannot be used."""
PLANNERS |= INSTALLED.planners
