"""The runs of the PCAO report, and how they are found again among those that were kept."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from app.evaluation.pcao.experiments import MAPS, OTHERS, CurveJob, ExperimentJob, FlightJob, flights, teams
from app.evaluation.pcao.report import Findings
from app.evaluation.pcao.terrains import sea_floor
from app.exploration.pcao.model import PcaoModel
from simulator.floors.terrain import Terrain

Run = Mapping[str, Any]

PARTS = ("curves", "tables", "others", "teams", "se500")
METHODS = ("pcao", "random", "cma")
TABLE2_ROWS = {"pcao": "C, best of algorithm 1", "random": "B, best of random search", "cma": "best of CMA-ES"}
FIRST = "A, first controller"
TEAM_TERRAINS = ("calibration_smooth.npz", "rugged:1")


@dataclass(frozen=True)
class Study:
    """One report's settings."""

    folder: Path | None
    seeds: Sequence[int]
    model: PcaoModel
    steps: int
    landmarks: int
    iterations: int
    searches: int
    team_seeds: Sequence[int]

    def at_hand(self, name: str) -> Terrain | None:
        """Return a sea floor by its file's name or as FAMILY:SEED; None where its file is not there."""
        if ":" in name:
            return sea_floor(name)
        path = None if self.folder is None else self.folder / name
        return sea_floor(str(path)) if path is not None and path.is_file() else None

    @cached_property
    def maps(self) -> dict[str, Terrain]:
        """What stands for the paper's maps, by their titles."""
        found = {paper.title: self.at_hand(paper.stands) for paper in MAPS}
        return {title: terrain for title, terrain in found.items() if terrain is not None}

    @property
    def training_maps(self) -> list[Terrain]:
        """Those that are trained on."""
        return [self.maps[paper.title] for paper in MAPS if paper.training and paper.title in self.maps]

    @cached_property
    def parts(self) -> dict[str, list[ExperimentJob]]:
        """The runs of each part; those of table II follow from the curves."""
        scale = (self.landmarks, self.steps)
        others = [terrain for terrain in map(self.at_hand, OTHERS) if terrain is not None]
        flyers = [terrain for terrain in map(self.at_hand, TEAM_TERRAINS) if terrain is not None]
        maps = list(self.maps.values())
        few = ("pcao", "SE(0)", "SE(5)", "SE(50)", "SPSA", "FDSA")
        return {
            "curves": [
                CurveJob(tuple(self.training_maps), method, search, self.iterations, landmarks=self.landmarks,
                         mission_steps=self.steps)
                for search in range(self.searches) for method in METHODS
            ],
            "tables": list(flights(maps, self.seeds, self.model, few, *scale)),
            "others": list(flights(others, self.seeds, self.model, ("pcao", "SE(5)"), *scale)),
            "teams": list(teams(flyers, self.team_seeds, self.model, *scale)),
            "se500": list(flights(self.training_maps, self.seeds, self.model, ("SE(500)",), *scale)),
        }  # fmt: skip

    def table2(self, runs: Mapping[str, Run]) -> list[FlightJob]:
        """Return the runs of table II: the first and the best controllers of the first searches that are there."""
        result = []
        for job in self.parts["curves"]:
            run = runs.get(job.key)
            if run is None or run["seed"] != 0:
                continue
            rows = [(TABLE2_ROWS[run["method"]], run["best"])]
            rows += [(FIRST, run["first"])] if run["method"] == "pcao" else []
            result += [
                FlightJob(terrain, row, seed, np.array(entries), landmarks=self.landmarks, steps=self.steps)
                for seed in self.seeds for terrain in self.training_maps for row, entries in rows
            ]  # fmt: skip
        return result

    def jobs(self, parts: Sequence[str], runs: Mapping[str, Run] | None = None) -> list[ExperimentJob]:
        """Return the runs of some parts; with the ``runs`` that there are, those of table II too."""
        wanted = [job for part in PARTS if part in parts for job in self.parts[part]]
        return wanted if runs is None else [*wanted, *self.table2(runs)]

    def findings(self, runs: Mapping[str, Run]) -> Findings:
        """Return the runs that there are of all parts."""

        def there(jobs: Sequence[ExperimentJob]) -> list[Run]:
            return [runs[job.key] for job in jobs if job.key in runs]

        every = {part: there(self.parts[part]) for part in PARTS}
        table2 = self.table2(runs)
        wanted = sum(len(self.parts[part]) for part in PARTS) + len(table2)
        have = sum(map(len, every.values())) + len(there(table2))
        return Findings(
            flights=[*every["tables"], *every["se500"]], table2=there(table2), curves=every["curves"],
            teams=every["teams"], others=every["others"], lacking=wanted - have,
            names={title: terrain.name for title, terrain in self.maps.items()}, landmarks=self.landmarks,
            steps=self.steps, seeds=self.seeds,
        )  # fmt: skip
