"""What is run for the report: sections of rows, each row one setup that is flown over terrains and seeds."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import orjson

from app.estimation import Sensor
from app.evaluation.explore.run import OSARSES, run_explore
from app.evaluation.explore.team_changes import TeamSchedule
from app.evaluation.explore.world import ExploreScenario
from app.evaluation.runs.jobs import Progress
from app.exploration.core.objective import TERMS, Terms
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import PLANNERS
from simulator.floors.terrain import Terrain

HISTORY_EVERY = 5
"""Steps between the values of the history that is kept."""

USEFUL = ("cao", "lawnmower", "rollout")
"""The planners that find nearly everything in time, for the harder cases."""


@dataclass(frozen=True)
class Setup:
    """One way of running the scenario.

    Attributes
    ----------
    planner : str
        By name.
    tries, objective
        Of ``osarses``: real tries per step, and the terms that count.
    robots, landmarks : int
        As in :class:`ExploreScenario`; landmarks None: one per cell.
    keep_out, lost, joining, line_of_sight, capacity
        As there.
    """

    planner: str
    tries: int = 0
    objective: Terms = "full"
    regressors: str = "map"
    robots: int = 3
    landmarks: int | None = 1100
    keep_out: float = 0.0
    lost: tuple[tuple[int, int], ...] = ()
    joining: tuple[tuple[int, int], ...] = ()
    line_of_sight: bool = False
    capacity: int | None = None

    def scenario(self, terrain: Terrain, seed: int, steps: int) -> ExploreScenario:
        """Return the scenario of one run."""
        return ExploreScenario(
            terrain,
            self.robots,
            self.landmarks,
            steps,
            seed,
            keep_out_fraction=self.keep_out,
            changes=TeamSchedule(self.lost, self.joining),
            line_of_sight=self.line_of_sight,
            capacity=self.capacity,
        )

    @property
    def options(self) -> PlannerOptions:
        """The planner's settings."""
        return PlannerOptions.model_validate(
            {"regressors": self.regressors, "tries": self.tries, "objective": self.objective}
        )


@dataclass(frozen=True)
class ReportSection:
    """One table of the report.

    Attributes
    ----------
    name : str
        For the command line.
    title, text : str
        Heading, and what stands below it.
    rows : tuple of (label, setup)
        In order.
    terrains : int or None
        How many of the terrains it uses, the first ones; None: all.
    published : dict
        Row label -> what the papers report, in words.
    """

    name: str
    title: str
    text: str
    rows: tuple[tuple[str, Setup], ...]
    terrains: int | None = None
    published: dict[str, str] = field(default_factory=dict)


def sections(steps: int, *, quick: bool = False) -> tuple[ReportSection, ...]:
    """Return the report's tables for runs of ``steps`` steps; the quick ones leave out what takes long.

    One function because it is a table.
    """
    change = max(1, steps // 10)
    many = 5 if quick else 50
    three, ten = Setup("cao"), Setup("cao", robots=10)
    tries = tuple(sorted({0, 5, many}))
    return (
        ReportSection(
            "table1",
            "AURO15 table 1: the plain objective J deadlocks",
            "OSARSES judged by J alone. Remaining landmarks after the last step.",
            tuple(
                (f"OSARSES({c}), {_landmarks(n)}", Setup(OSARSES, c, "J", landmarks=n))
                for n in _landmark_counts(quick)
                for c in tries[1:]
            ),
            2,
            {
                "OSARSES(5), 1100 landmarks": "91.9 / 87.5 %",
                "OSARSES(50), 1100 landmarks": "88.9 / 89.6 % (with 500 tries 85.3 / 89.8 %)",
                "OSARSES(5), every cell": "84.9 / 87.8 %",
                "OSARSES(50), every cell": "85 / 86.3 % (70 tries)",
            },
        ),
        ReportSection(
            "figure2",
            "AURO15 figure 2: what each term is worth",
            f"OSARSES({many}) judged by J and the named terms. The paper gives bars and says that J1 brings "
            "the dramatic improvement.",
            tuple(
                ("J + J1 + J2 + J3" if terms == "full" else terms.replace("+", " + "), Setup(OSARSES, many, terms))
                for terms in TERMS
                if terms != "med13"
            ),
            2,
            {"J": "85-92 %", "J + J1 + J2 + J3": "1.8 % (Map #1, 500 tries)"},
        ),
        *(
            ReportSection(
                f"figure{number}",
                f"AURO15 figure {number}: {cao.robots} vehicles",
                "OSARSES(C) really tries C moves per step, which no vehicle can; the others try none. The paper's CAO "
                "is nearest to the polynomial regressors.",
                tuple(
                    (f"{label}, {_landmarks(n)}", replace(setup, landmarks=n))
                    for n in _landmark_counts(quick)
                    for label, setup in (
                        *(
                            (f"OSARSES({c})", Setup(OSARSES, c, robots=cao.robots))
                            for c in tries
                            if n is not None or c < many or quick  # every cell tried 50 times takes days
                        ),
                        ("CAO, polynomial", replace(cao, regressors="polynomial")),
                        ("CAO, map", cao),
                        ("lawnmower", replace(cao, planner="lawnmower")),
                        ("rollout", replace(cao, planner="rollout")),
                    )
                ),
                2,
                published,
            )
            for number, cao, published in (
                (
                    5,
                    three,
                    {
                        "OSARSES(0), 1100 landmarks": "86.85 / 91.58 % (PCAO18)",
                        "OSARSES(5), 1100 landmarks": "23.2 / 40.67 % (PCAO18)",
                        "OSARSES(50), 1100 landmarks": "3.89 / 13.4 % (PCAO18)",
                        "CAO, polynomial, 1100 landmarks": "about 17.6 / 37 %",
                    },
                ),
                (6, ten, {"CAO, polynomial, 1100 landmarks": "80.2 / 71.4 % better than OSARSES(0)"}),
            )
        ),
        ReportSection(
            "planners",
            "Planners against the formation lawnmower",
            "t99: first step with at most 1 % remaining. The lawnmower flies under the same constraints, waits for its "
            "vehicles and visits what its lines left over.",
            _planner_rows(Setup("cao")),
        ),
        *(
            ReportSection(name, title, text, _planner_rows(setup, USEFUL))
            for name, title, text, setup in (
                (
                    "keep-out",
                    "Keep-out zones over 15 % of the area",
                    "Rectangles drawn by the seed.",
                    Setup("cao", keep_out=0.15),
                ),
                (
                    "lose",
                    f"One of three vehicles lost at step {change}",
                    "The second one.",
                    Setup("cao", lost=((2, change),)),
                ),
                (
                    "join",
                    f"A fourth vehicle joins at step {change}",
                    "Launched near another.",
                    Setup("cao", joining=((1, change),)),
                ),
                (
                    "capacity",
                    "Ten landmark entries per message",
                    "AURO15 section 3.4: the planner knows only what was transmitted; range 0.3 as always.",
                    Setup("cao", capacity=10),
                ),
                (
                    "line-of-sight",
                    "The sea floor hides what lies behind it",
                    "AURO15 eq. (24); the planners are not told.",
                    Setup("cao", line_of_sight=True),
                ),
            )
        ),
    )


def _landmarks(count: int | None) -> str:
    return "every cell" if count is None else f"{count} landmarks"


def _landmark_counts(quick: bool) -> tuple[int | None, ...]:
    return (300,) if quick else (1100, None)


def _planner_rows(setup: Setup, names: Collection[str] = PLANNERS) -> tuple[tuple[str, Setup], ...]:
    """Return the setup with these planners."""
    rows = []
    for name in sorted(names):
        if name == "cao":
            rows.append(("CAO, map", replace(setup, planner=name)))
            if names is PLANNERS:
                rows.append(("CAO, polynomial", replace(setup, planner=name, regressors="polynomial")))
        else:
            rows.append((name, replace(setup, planner=name)))
    return tuple(rows)


@dataclass(frozen=True)
class TableJob:
    """One run for the report."""

    setup: Setup
    terrain: Terrain
    seed: int
    steps: int

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"{self.setup.planner}, {self.terrain.name}, seed {self.seed}"

    @property
    def key(self) -> str:
        """What makes the run what it is, as text: equal keys, equal results."""
        return run_key(self.setup, self.terrain.name, self.seed, self.steps)

    @property
    def sensor(self) -> Sensor:
        """What its vehicles measure with."""
        return self.setup.scenario(self.terrain, self.seed, self.steps).sensor

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it; the history is thinned."""
        scenario = self.setup.scenario(self.terrain, self.seed, self.steps)
        result = asdict(run_explore(scenario, self.setup.planner, self.setup.options, progress))
        result["history"] = [round(x, 3) for x in result["history"][HISTORY_EVERY - 1 :: HISTORY_EVERY]]
        return {"key": self.key, "setup": asdict(self.setup), **result}


def run_key(setup: Setup, terrain: str, seed: int, steps: int) -> str:
    """Return what makes a run what it is, as text."""
    return orjson.dumps([asdict(setup), terrain, seed, steps], option=orjson.OPT_SORT_KEYS).decode()


def jobs_of(
    chosen: Sequence[ReportSection], terrains: Sequence[Terrain], seeds: Sequence[int], steps: int
) -> Iterator[TableJob]:
    """Yield every run once, seed by seed, so that an interrupted evaluation has whole seeds."""
    seen: set[str] = set()
    for seed in seeds:
        for section in chosen:
            for terrain in terrains[: section.terrains]:
                for _, setup in section.rows:
                    job = TableJob(setup, terrain, seed, steps)
                    if job.key not in seen:
                        seen.add(job.key)
                        yield job
