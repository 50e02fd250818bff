"""The tasks by name, and one of them over one floor as a job."""

from dataclasses import asdict, dataclass
from typing import Any

import orjson

from app.estimation import RangeSensor, Scanner, Sensor, SingleBeam
from app.evaluation.generalize import flights
from app.evaluation.generalize.flights import Flight, Size
from app.evaluation.runs.jobs import Progress
from simulator.floors.unseen_floors import unseen_floor


@dataclass(frozen=True)
class TableTask:
    """One task of the table.

    Attributes
    ----------
    figure : str
        What is compared, with its unit.
    yardstick : str
        What with.
    asked : str
        What the project asks of every floor.
    relative : bool
        Whether the table tells ratios to a yardstick that was flown; else the figure itself.
    flight : callable
        Flies it.
    size_m : (2,)
        Extent of its floors, east and north.
    sensor : Sensor or None
        For which planners are compiled.
    """

    figure: str
    yardstick: str
    asked: str
    relative: bool
    flight: Flight
    size_m: tuple[float, float]
    sensor: Sensor | None


TASKS: dict[str, TableTask] = {
    "explore": TableTask(
        "steps to 99 % of 1100 landmarks", "the formation lawnmower", "none above 0.85 of it", True, flights.explore,
        (100.0, 100.0), RangeSensor(),
    ),
    "track": TableTask(
        "landmarks left of MED13's 1000, %", "the 1 % asked", "1 % left, targets tracked 90 % of the time", False,
        flights.track, (100.0, 100.0), RangeSensor(0.4, 0.1),
    ),
    "pcao": TableTask(
        "landmarks left, %, in the worse of two scenarios", "the 1 % asked", "1 % left in both scenarios", False,
        flights.pcao, (100.0, 100.0), RangeSensor(),
    ),
    "search": TableTask(
        "goal area not explored, %", "11.1 %, what ACCESS13's CAO leaves of its first car park",
        "no more, back in time, nothing touched", False, flights.search, (150.0, 150.0), Scanner(),
    ),
    "survey": TableTask(
        "RMSE of the map, m", "the best of three patterns", "none above 1.05 of it", True, flights.survey,
        (100.0, 100.0), SingleBeam(0.01),
    ),
    "coverage": TableTask(
        "kilometres flown", "fixed lines, spaced for the shoalest depth", "none above 1.02 of them, no holiday", True,
        flights.coverage, (140.0, 100.0), None,
    ),
}  # fmt: skip
"""In the order of the table."""

QUICK_PART = 0.3
"""Part of a floor's extent that a small version is flown over, where the extent matters."""


@dataclass(frozen=True)
class FloorJob:
    """A task over one unseen floor."""

    task: str
    family: str
    seed: int
    size: Size = "full"
    steps: int = 1

    @property
    def key(self) -> str:
        """What makes the run what it is, as text."""
        return orjson.dumps([self.task, self.family, self.seed, self.size]).decode()

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"{self.task}, {self.family}:{self.seed}"

    @property
    def sensor(self) -> Sensor | None:
        """What its vehicles measure with."""
        return TASKS[self.task].sensor

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it."""
        task = TASKS[self.task]
        scale = QUICK_PART if self.size == "quick" and self.task in ("survey", "coverage", "search") else 1.0
        width_m, height_m = (scale * side for side in task.size_m)
        floor = unseen_floor(self.family, self.seed, width_m=width_m, height_m=height_m)
        trial = task.flight(floor, self.seed, self.size)
        progress(1)
        return {
            "key": self.key, "task": self.task, "family": self.family, "seed": self.seed, "floor": floor.name,
            **asdict(trial),
        }  # fmt: skip
