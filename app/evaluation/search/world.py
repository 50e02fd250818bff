"""Search and rescue without a network (ACCESS13 section V): vehicles with scanners in a world of obstacles."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from app.arrays import FloatArray
from app.estimation.occupancy import Cell, OccupancyGrid, Scanner
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner
from app.exploration.site_search import SearchTask
from simulator.obstacles.obstacles import ObstacleWorld

BODY_M = 0.35
"""Half the length of the robot: closer than that to an obstacle is a collision."""
LONGEST_STEPS = 60.0
"""How far the supervisor may raise alpha: a leg across the longest free line of sight in sight of anything."""
CHECK_M = 0.05
"""Distance between the places on a leg at which that is looked at."""


@dataclass(frozen=True)
class SearchScenario:
    """A search in a world of obstacles.

    Attributes
    ----------
    world : ObstacleWorld
        With entry, goal and transmitter.
    goal_radius_m : float
        ``r_c``.
    window_m : float
        The time window, as the way that a robot can travel in it.
    robots : int
        Size of the team, entering side by side.
    step_m : float
        First length of a step: alpha = 1.
    com_range_m : float
        ``C_r``.
    safety_m : float
        ``d_r``.
    scanner : Scanner
        Of every robot.
    clock : "way" or "steps"
        What uses up the window: the way that is travelled; or steps, however long their legs, as in the paper, where
        the supervisor's long legs cost nothing.
    seed : int
        Of everything random.
    """

    world: ObstacleWorld
    goal_radius_m: float = 50.0
    window_m: float = 3000.0
    robots: int = 1
    step_m: float = 1.0
    com_range_m: float = 200.0
    safety_m: float = 1.0
    scanner: Scanner = Scanner()  # noqa: RUF009 - frozen
    clock: Literal["way", "steps"] = "way"
    seed: int = 0

    @property
    def constraints(self) -> Constraints:
        """The world's rectangle; robots keep 2 m apart. A step may be as long as the supervisor raises it."""
        width, height = self.world.size_m
        area = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
        return Constraints(area, max_step_m=LONGEST_STEPS * self.step_m, min_altitude_m=0.0, min_separation_m=2.0)

    @property
    def starts_m(self) -> FloatArray:
        """Where the robots start, (robots, 3): in a row at the entry, 2.5 m apart."""
        k = np.arange(self.robots) - (self.robots - 1) / 2
        return np.column_stack(
            [self.world.entry_m[0] + 2.5 * k, np.full(self.robots, self.world.entry_m[1]), np.zeros(self.robots)]
        )


@dataclass(frozen=True)
class SearchTrack:
    """A search that was run.

    Attributes
    ----------
    positions_m : (steps + 1, robots, 3)
        After every step.
    explored, explored_goal : (steps + 1,)
        F_1 and F_2.
    left_m : (steps + 1,)
        What was left of the window.
    grid : OccupancyGrid
        What was known in the end.
    collisions, too_close : int
        Legs on which a robot touched an obstacle, or came closer than the safety distance.
    longest_standstill_m, last_standstill_m : float
        Most of the window that went by between one new cell and the next, and what went by after the last one, while
        the team searched: ways home and waiting there are left out.
    plan_s, plan_cpu_s : (steps,)
        Time that decisions took, and what of it they computed.
    """

    positions_m: FloatArray
    explored: FloatArray
    explored_goal: FloatArray
    left_m: FloatArray
    grid: OccupancyGrid
    collisions: int
    too_close: int
    longest_standstill_m: float
    last_standstill_m: float
    plan_s: FloatArray
    plan_cpu_s: FloatArray


def run_search(
    scenario: SearchScenario,
    planner: str,
    options: PlannerOptions,
    progress: Callable[[int], None] = lambda step: None,
) -> SearchTrack:
    """Run the closed loop until all robots are home for good or the time is up."""
    world, scanner = scenario.world, scenario.scanner
    chooser = create_planner(planner, options, scanner)
    rng = np.random.default_rng([scenario.seed, 11])
    names = tuple(f"robot-{k + 1}" for k in range(scenario.robots))
    positions = scenario.starts_m
    grid = OccupancyGrid.from_blueprint(world.known, world.cell_m)
    for position in positions:
        grid = _scanned(grid, scenario, position)
    left, standstill, longest = scenario.window_m, 0.0, 0.0
    task = _task(scenario, grid, left)
    history, explored, goal, lefts, times = [positions], [task.explored_part], [task.explored_goal_part], [left], []
    computed = []
    collisions = too_close = 0
    nothing = Belief(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.bool_), np.zeros(0), 1.0)
    total = int(np.ceil(scenario.window_m / scenario.step_m))
    for step in range(1, total + 1):
        situation = Situation(
            step, total, names, positions, np.full(scenario.robots, np.nan), nothing, np.zeros((0, 2)),
            scenario.constraints, search=task,
        )  # fmt: skip
        begun = time.perf_counter(), time.thread_time()
        proposal = chooser.propose(situation, rng)
        times.append(time.perf_counter() - begun[0])
        computed.append(time.thread_time() - begun[1])
        legs = np.linalg.norm(proposal.positions - positions, axis=1)
        gone = float(legs.max())
        for start, end in zip(positions, proposal.positions, strict=True):
            points = _along(start, end, CHECK_M)
            clearance = float(world.clearance_m(points[:, :2]).min())
            collisions += clearance < BODY_M
            too_close += clearance < scenario.safety_m - 1e-6
            for point in _along(start, end, scenario.step_m):
                grid = _scanned(grid, scenario, point)
        positions = proposal.positions
        used = gone if gone > 0.0 and scenario.clock == "way" else scenario.step_m
        left -= used
        before = task.explored_part
        task = _task(scenario, grid, left)
        home = proposal.terms["at_home"] == scenario.robots
        searching = not (home or proposal.terms["homewards"] or proposal.terms["homebound"])
        standstill = 0.0 if task.explored_part > before else standstill + used * searching
        longest = max(longest, standstill)
        history.append(positions)
        explored.append(task.explored_part)
        goal.append(task.explored_goal_part)
        lefts.append(left)
        progress(step)
        if left <= 0.0 or (gone == 0.0 and home and proposal.terms["homebound"]):
            break
    return SearchTrack(
        np.array(history), np.array(explored), np.array(goal), np.array(lefts), grid, collisions, too_close, longest,
        standstill, np.array(times), np.array(computed),
    )  # fmt: skip


def fully_explored(scenario: SearchScenario) -> NDArray[np.bool_]:
    """Return the free cells (rows, cols) that can be seen from anywhere a robot can get to.

    The paper compares with "the fully explored map". A gap between parked cars may be out of sight of every robot.
    """
    world = scenario.world
    rows, cols = world.solid.shape
    centres = OccupancyGrid.from_blueprint(world.known, world.cell_m).centres_m
    open_ = world.clearance_m(centres.reshape(-1, 2)).reshape(rows, cols) >= scenario.safety_m
    parts, _ = label(open_)
    row, col = (int(x) for x in world.entry_m[::-1] / world.cell_m)
    grid = OccupancyGrid.from_blueprint(world.known, world.cell_m)
    for place in centres[parts == parts[row, col]]:
        grid = _scanned(grid, scenario, place)
    return np.asarray(grid.states == Cell.EXPLORED)


def explored_pct(grid: OccupancyGrid, all_: NDArray[np.bool_]) -> float:
    """Return the percentage of some cells (rows, cols) that were explored."""
    return 100.0 * float(np.count_nonzero(all_ & (grid.states == Cell.EXPLORED))) / max(1, int(np.count_nonzero(all_)))


def _task(scenario: SearchScenario, grid: OccupancyGrid, left_m: float) -> SearchTask:
    world = scenario.world
    return SearchTask(
        grid, scenario.scanner, world.goal_m, scenario.goal_radius_m, world.entry_m, world.transmitter_m,
        scenario.com_range_m, scenario.safety_m, scenario.step_m, left_m, scenario.window_m,
    )  # fmt: skip


def _along(start: FloatArray, end: FloatArray, every_m: float) -> FloatArray:
    """Return places (n, 3) on a leg, its start left out, its end among them; one place when it has no length."""
    n = max(1, int(np.ceil(np.linalg.norm(end - start) / every_m - 1e-9)))
    return start + (np.arange(1, n + 1) / n)[:, None] * (end - start)


def _scanned(grid: OccupancyGrid, scenario: SearchScenario, position: FloatArray) -> OccupancyGrid:
    bearings = scenario.scanner.bearings_rad
    ranges = scenario.world.scan(position, bearings, scenario.scanner.reach_m)
    return grid.seen_from(position, bearings, ranges, scenario.scanner.reach_m)
