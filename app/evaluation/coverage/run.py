"""One survey of the comparison as a job for :mod:`app.evaluation.runs.jobs`."""

import math
from dataclasses import asdict, dataclass
from typing import Any

from app.estimation import Sensor
from app.evaluation.coverage.surveys import fly_dune_rows, fly_fixed, fly_from_edges, fly_ours
from app.evaluation.coverage.world import CoverageScenario, outcome
from app.evaluation.runs.jobs import Progress

SURVEYS = 5


@dataclass(frozen=True)
class CoverageJob:
    """All surveys of one scenario."""

    scenario: CoverageScenario

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"{self.scenario.terrain.name}, {self.scenario.vehicles} vehicles, seed {self.scenario.seed}"

    @property
    def steps(self) -> int:
        """Its length."""
        return SURVEYS

    @property
    def sensor(self) -> Sensor | None:
        """No planner has to be warmed up."""
        return None

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it. ``ratio_…`` are kilometres of ours over those of another survey."""
        scenario = self.scenario
        ours = outcome(fly_ours(scenario))
        progress(1)
        known = outcome(fly_ours(scenario, known=True))
        progress(2)
        fixed = outcome(fly_fixed(scenario))
        progress(3)
        rows = outcome(fly_dune_rows(scenario))
        progress(4)
        edges = outcome(fly_from_edges(scenario))
        progress(5)
        depth = scenario.true_depth_m()[scenario.wanted()]
        return {
            "terrain": scenario.terrain.name,
            "vehicles": scenario.vehicles,
            "seed": scenario.seed,
            "sonar_deg": round(math.degrees(scenario.sonar.aperture_rad), 3),
            "beams": scenario.sonar.beams,
            "cell_m": scenario.cell_m,
            "speed_mps": scenario.speed_mps,
            "depth_m": [round(float(depth.min()), 2), round(float(depth.max()), 2)],
            **asdict(ours),
            "ratio_fixed": ours.km / fixed.km,
            "ratio_known": ours.km / known.km,
            "ratio_dune_rows": ours.km / rows.km,
            "ratio_edges": ours.km / edges.km,
            "known": asdict(known),
            "fixed": asdict(fixed),
            "dune_rows": asdict(rows),
            "edges": asdict(edges),
        }
