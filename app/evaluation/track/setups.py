"""What is run for the tracking report: the papers' experiments, each flown by several planners over seeds."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import orjson

from app.estimation import Fading, Sensor
from app.evaluation.runs.jobs import Progress
from app.evaluation.track.run import run_track
from app.evaluation.track.trace_greedy import TRACE_GREEDY
from app.evaluation.track.world import TrackScenario
from app.exploration.planner.options import PlannerOptions
from simulator.floors.terrain import Terrain

HISTORY_EVERY = 10
"""Steps between the values of the histories that are kept."""

FIGURE1_STEPS = 200
EVERYWHERE = 4.0
"""Sight that is unlimited in the cube, whose diagonal is 3.46."""

FIXED_NOISE = 0.1
"""Deviation of ranges that a filter believes in which does not know that it grows with the range: that at range 1."""

LATER = {"fixed_noise": None}
"""Parts of a scenario that came later: at these values they are left out of a run's key, so that kept runs stay."""

DEFAULT = "rollout"
ROLLOUTS = 100
"""Changes to the plan per step: landmarks with two axes each make flights long."""


@dataclass(frozen=True)
class Experiment:
    """One experiment of the papers.

    Attributes
    ----------
    name, title, text
        What it is and what there is to say.
    planners : tuple of str
        Who flies it.
    scenario : TrackScenario
        Its setting; ``seed`` and ``terrain`` are replaced.
    on_terrain : bool
        Whether its landmarks lie on a sea floor.
    """

    name: str
    title: str
    text: str
    planners: tuple[str, ...]
    scenario: TrackScenario
    on_terrain: bool


def experiments(steps: int = 500) -> tuple[Experiment, ...]:
    """Return the experiments in the order of the report."""
    ngcuv = TrackScenario(landmarks=300, fading=Fading(), steps=steps)
    return (
        *(
            Experiment(
                f"med13-{count}",
                f"MED13: 3 vehicles, 2 targets, {count} landmarks",
                "Landmarks on a sea floor, known places of the vehicles, clearance 0.3, sight 0.4, the floor hides "
                "what lies behind it.",
                (DEFAULT, "cao", "random"),
                TrackScenario(landmarks=count, steps=steps),
                on_terrain=True,
            )
            for count in (1000, 7542)
        ),
        Experiment(
            "ngcuv12",
            "NGCUV12: 300 landmarks in the lower half of the cube, 2 targets, localization fades",
            "A fix of one vehicle relocalizes all, as in the paper.",
            ("cao", "random"),
            ngcuv,
            on_terrain=False,
        ),
        Experiment(
            "ngcuv12-own-fix",
            "The same, but each vehicle needs its own fix or ranges",
            "Vehicles range to each other with 1 % noise; the cooperative filter passes on what a fix of one is worth.",
            ("cao",),
            replace(ngcuv, shared_fix=False),
            on_terrain=False,
        ),
        *(
            Experiment(
                name,
                f"MED13 figure 1: greedy on the trace of the covariance, {filter_}",
                "30 landmarks anywhere in the lower half of the cube, unlimited sight, no targets; every combination "
                "of moves is weighed.",
                (TRACE_GREEDY, "cao"),
                TrackScenario(
                    landmarks=30,
                    targets=0,
                    visibility=EVERYWHERE,
                    steps=min(steps, FIGURE1_STEPS),
                    plain_ekf=plain,
                    fixed_noise=fixed,
                ),
                on_terrain=False,
            )
            for name, filter_, plain, fixed in (
                ("figure1", "plain EKF", True, None),
                ("figure1-fixed", "plain EKF that takes its noise to be of a fixed size", True, FIXED_NOISE),
                ("figure1-ours", "our filter", False, None),
            )
        ),
    )


@dataclass(frozen=True)
class TrackJob:
    """One run."""

    setup: str
    planner: str
    scenario: TrackScenario
    options: PlannerOptions

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"{self.setup}, {self.planner}, seed {self.scenario.seed}"

    @property
    def steps(self) -> int:
        """Its length."""
        return self.scenario.steps

    @property
    def key(self) -> str:
        """What makes the run what it is, as text."""
        facts = {
            name: value
            for name, value in asdict(replace(self.scenario, terrain=None)).items()
            if name != "terrain" and not (name in LATER and value == LATER[name])
        }
        terrain = None if self.scenario.terrain is None else self.scenario.terrain.name
        options = self.options.model_dump(exclude_defaults=True)
        listed = [self.setup, self.planner, terrain, repr(sorted(facts.items())), options]
        return orjson.dumps(listed, option=orjson.OPT_SORT_KEYS).decode()

    @property
    def sensor(self) -> Sensor:
        """What its vehicles see landmarks with."""
        return self.scenario.sensor

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it."""
        return asdict(run_track(self.scenario, self.planner, self.options, self.setup, progress))


@dataclass(frozen=True)
class TrackReportJob(TrackJob):
    """One run for the report: with its key, histories thinned."""

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it."""
        result = super().run(progress)
        for name in ("history", "error"):
            result[name] = [round(x, 4) for x in result[name][HISTORY_EVERY - 1 :: HISTORY_EVERY]]
        return {"key": self.key, **result}


def report_jobs(
    chosen: Sequence[Experiment], terrain: Terrain, seeds: Sequence[int], rollouts: int = ROLLOUTS
) -> Iterator[TrackReportJob]:
    """Yield every run, seed by seed, so that an interrupted evaluation has whole seeds."""
    options = PlannerOptions(rollouts=rollouts)
    for seed in seeds:
        for experiment in chosen:
            where = terrain if experiment.on_terrain else None
            for planner in experiment.planners:
                yield TrackReportJob(
                    experiment.name, planner, replace(experiment.scenario, terrain=where, seed=seed), options
                )
