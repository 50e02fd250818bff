"""What is run for the PCAO report: the paper's maps and tables, the yardsticks with their costs, other teams."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any, Protocol

import numpy as np
import orjson

from app.arrays import FloatArray
from app.estimation import RangeSensor, Sensor
from app.evaluation.explore.run import OSARSES, run_explore
from app.evaluation.explore.world import ExploreScenario
from app.evaluation.pcao.simulation.oracles import FDSA, SE, SPSA, fly_tried, tries_per_step
from app.evaluation.pcao.simulation.task import TrainingTask
from app.evaluation.pcao.simulation.world import LANDMARKS, ROBOTS, STEPS, SeaFloor
from app.evaluation.pcao.training.optimisers import METHODS
from app.evaluation.runs.jobs import Job, Progress
from app.exploration.pcao.model import PcaoModel
from app.exploration.planner.options import PlannerOptions
from simulator.floors.terrain import Terrain

HISTORY_EVERY = 10
UNLIMITED = 10.0
"""A communication range beyond the cube: PCAO18 knows no such limit."""


@dataclass(frozen=True)
class PaperMap:
    """One of the paper's sea floors, none of which was published, and what stands for it here."""

    title: str
    stands: str
    training: bool


MAPS = (
    PaperMap("Real Map 1", "monterey_canyon.npz", True),
    PaperMap("Artificial Map 1", "harbour:1", True),
    PaperMap("Real Map 2", "leixoes_slope.npz", False),
    PaperMap("Real Map 3", "fortbragg_gully.npz", False),
    PaperMap("Artificial Map 2", "reef_field:1", False),
)
OTHERS = (
    "monterey_coast_range.npz", "calibration_smooth.npz", "leixoes_sharp_diagonal.npz", "jd211_curved_ridge.npz",
    "rugged:2", "canyon:2", "ridge:2", "slope:2",
)  # fmt: skip
"""Further sea floors that the controller never saw."""

YARDSTICKS = {
    "SE(0)": (SE, 0), "SE(5)": (SE, 5), "SE(50)": (SE, 50), "SE(500)": (SE, 500), "SPSA": (SPSA, 0), "FDSA": (FDSA, 0),
}  # fmt: skip
TEAMS = (2, 5, 10)
PCAO = "pcao"
"""The controller as missions fly it."""


class ExperimentJob(Job, Protocol):
    """One piece of the report."""

    @property
    def key(self) -> str:
        """What makes it what it is, as text."""
        ...


@dataclass(frozen=True, eq=False)
class FlightJob:
    """One mission in PCAO18's simulation, led by a controller or by a yardstick."""

    terrain: Terrain
    algorithm: str
    seed: int
    parameters: FloatArray | None = None
    robots: int = ROBOTS
    landmarks: int = LANDMARKS
    steps: int = STEPS
    sensor: None = None

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"{self.algorithm}, {self.terrain.name}, seed {self.seed}"

    @property
    def key(self) -> str:
        """What makes the run what it is, as text."""
        facts = [self.terrain.name, self.algorithm, self.robots, self.landmarks, self.steps, self.seed]
        how = ["visiting"] if self.visiting else []
        return orjson.dumps(["flight", *facts, digest(self.parameters), *how]).decode()

    @property
    def visiting(self) -> bool:
        """Whether the controller visits landmarks where it gets nowhere; those of table II and yardsticks do not."""
        return self.algorithm == PCAO

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it."""
        floor = SeaFloor(self.terrain)
        how = (self.robots, self.landmarks, self.steps)
        task = TrainingTask((floor,), (self.seed,), *how, visiting=self.visiting)
        began = time.process_time()
        tries = 0
        if self.parameters is not None:
            remaining, error = task.run(floor, self.seed, self.parameters)
        else:
            method, candidates = YARDSTICKS[self.algorithm]
            landmarks, start, headings = floor.draw(self.seed, self.robots, self.landmarks)
            rng = np.random.default_rng([self.seed, 1])
            remaining, error = fly_tried(
                floor.raster, floor.physics, landmarks, start, headings, method, candidates, self.steps, rng
            )
            tries = tries_per_step(method, candidates, self.robots)
        share = 100.0 * remaining / self.landmarks
        done = np.flatnonzero(share <= 1.0)
        return {
            "key": self.key, "terrain": self.terrain.name, "algorithm": self.algorithm, "robots": self.robots,
            "seed": self.seed, "remaining_pct": float(share[-1]), "cost": task.cost(remaining, error),
            "t99": int(done[0]) + 1 if len(done) else None, "mapping_time": self.steps * (1 + tries),
            "cpu_s": time.process_time() - began,
            "history": [round(float(x), 3) for x in share[HISTORY_EVERY - 1 :: HISTORY_EVERY]],
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class TeamJob:
    """One mission of AURO15's scenario, where the literal CAO flies too, without a limit to communication."""

    terrain: Terrain
    algorithm: str
    robots: int
    seed: int
    options: PlannerOptions
    planner: str
    steps: int = STEPS
    landmarks: int = LANDMARKS

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"{self.algorithm}, {self.robots} vehicles, {self.terrain.name}, seed {self.seed}"

    @property
    def sensor(self) -> Sensor:
        """What its vehicles measure with."""
        return RangeSensor()

    @property
    def key(self) -> str:
        """What makes the run what it is, as text."""
        model = self.options.model
        facts = [self.terrain.name, self.algorithm, self.robots, self.landmarks, self.steps, self.seed]
        how = ["visiting"] if self.algorithm == PCAO else []
        return orjson.dumps(["team", *facts, digest(None if model is None else model.parameters), *how]).decode()

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it."""
        scenario = ExploreScenario(
            self.terrain, self.robots, self.landmarks, self.steps, self.seed, com_range=UNLIMITED
        )
        run = run_explore(scenario, self.planner, self.options, progress)
        return {
            "key": self.key, "terrain": self.terrain.name, "algorithm": self.algorithm, "robots": self.robots,
            "seed": self.seed, "remaining_pct": run.remaining_pct, "t99": run.t99,
            "plan_ms_median": run.plan_ms_median,
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class CurveJob:
    """A training of figure 2: a number of controllers of a method, scored one after the other on one core."""

    terrains: tuple[Terrain, ...]
    method: str
    seed: int
    evaluations: int
    seeds: tuple[int, ...] = (0, 1, 2)
    landmarks: int = LANDMARKS
    mission_steps: int = STEPS
    sensor: None = field(default=None)

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"training by {self.method}, seed {self.seed}"

    @property
    def steps(self) -> int:
        """Its length."""
        return self.evaluations

    @property
    def key(self) -> str:
        """What makes the training what it is, as text."""
        facts = [[t.name for t in self.terrains], self.method, self.seed, self.evaluations, list(self.seeds)]
        return orjson.dumps(["curve", *facts, self.landmarks, self.mission_steps]).decode()

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it."""
        floors = tuple(SeaFloor(terrain) for terrain in self.terrains)
        task = TrainingTask(floors, self.seeds, landmarks=self.landmarks, steps=self.mission_steps)
        optimiser = METHODS[self.method](self.seed)
        scores: list[float] = []
        first: FloatArray | None = None
        while len(scores) < self.evaluations:
            asked = optimiser.ask()
            first = asked[0] if first is None else first
            told = [task.score(task.costs(parameters, task.cases)) for parameters in asked]
            optimiser.tell(asked, told)
            scores += told
            progress(min(len(scores), self.evaluations))
        return {
            "key": self.key, "method": self.method, "seed": self.seed, "scores": [round(s, 4) for s in scores],
            "first": [] if first is None else first.tolist(), "best": optimiser.best.tolist(),
        }  # fmt: skip


def digest(parameters: FloatArray | None) -> str:
    """Return what distinguishes controllers."""
    return "" if parameters is None else sha256(np.round(parameters, 9).tobytes()).hexdigest()[:12]


def flights(
    terrains: Sequence[Terrain],
    seeds: Sequence[int],
    model: PcaoModel,
    algorithms: Sequence[str],
    landmarks: int = LANDMARKS,
    steps: int = STEPS,
) -> Iterator[FlightJob]:
    """Yield the missions of ``pcao`` and of yardsticks, seed by seed."""
    for seed in seeds:
        for terrain in terrains:
            for name in algorithms:
                parameters = model.parameters if name == PCAO else None
                yield FlightJob(terrain, name, seed, parameters, landmarks=landmarks, steps=steps)


def teams(
    terrains: Sequence[Terrain], seeds: Sequence[int], model: PcaoModel, landmarks: int = LANDMARKS, steps: int = STEPS
) -> Iterator[TeamJob]:
    """Yield the missions of other teams, seed by seed."""
    literal = PlannerOptions(regressors="polynomial", contribution="team")
    kinds = (
        (PCAO, PlannerOptions(model=model), "pcao"),
        ("literal CAO", literal, "cao"),
        ("SE(0)", PlannerOptions(tries=0), OSARSES),
    )
    for seed in seeds:
        for terrain in terrains:
            for robots in TEAMS:
                for name, options, planner in kinds:
                    yield TeamJob(terrain, name, robots, seed, options, planner, steps, landmarks)
