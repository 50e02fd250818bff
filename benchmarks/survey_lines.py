"""A survey of few soundings beside a lawnmower with lines 10 m apart that sounds every half metre.

    python benchmarks/survey_lines.py TERRAIN.npz [--symmetries 0:3] [--max-step 2.5]

The planner flies 2 vehicles for 500 steps with one sounding each; noise is 1 % of the range. Both sets of soundings are
mapped by the better of the default map and a stationary Matern 3/2 process, the planner's by the default map alone.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.evaluation.survey.run import judge
from app.evaluation.survey.symmetry import turned
from app.evaluation.survey.world import SurveyScenario, fly_planner
from app.exploration.planner.options import PlannerOptions
from simulator.terrain_files import load_terrain

SPACING_M, ALONG_M, DEPTH_M = 10.0, 0.5, 2.5


def compare(file: Path, symmetry: int, max_step_m: float) -> str:
    """Return a line of the table for one symmetry of the square."""
    terrain = turned(replace(load_terrain(file), name=file.stem), symmetry)
    scenario = SurveyScenario(terrain, 2, 500, max_step_m, "step", seed=symmetry, symmetry=symmetry)
    east, north = np.meshgrid(
        np.arange(SPACING_M / 2, terrain.width_m, SPACING_M), np.arange(ALONG_M / 2, terrain.height_m, ALONG_M)
    )
    log = scenario.log(2)
    log.sound(np.column_stack([east.ravel(), north.ravel(), np.full(east.size, DEPTH_M)]))
    lines = judge(scenario, log.soundings, np.zeros(1), yardstick=True)
    track = fly_planner(scenario, "cao", PlannerOptions())
    ours = judge(scenario, track.soundings, track.distance_m)
    return (
        f"symmetry {symmetry}: lines {lines.rmse_m:.3f} m ({lines.samples} soundings), "
        f"ours {ours.rmse_m:.3f} m ({ours.samples}), ratio {ours.rmse_m / lines.rmse_m:.2f}"
    )


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("terrain", type=Path)
    parser.add_argument("--symmetries", default="0:3")
    parser.add_argument("--max-step", type=float, default=2.5)
    options = parser.parse_args()
    first, end = (int(part) for part in options.symmetries.split(":"))
    for symmetry in range(first, end):
        print(compare(options.terrain, symmetry, options.max_step), flush=True)


if __name__ == "__main__":
    main()
