"""A survey of few soundings beside a lawnmower with lines 10 m apart that sounds every half metre.

    python -m benchmarks.planning.survey_lines TERRAIN.npz [--seeds 0 1 2] [--max-step 2.5]

The planner flies 2 vehicles for 500 steps with one sounding each; noise is 1 % of the range. Both sets of soundings are
mapped by the better of the default map and a stationary Matern 3/2 process, the planner's by the default map alone.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from app.evaluation.survey.run import judge
from app.evaluation.survey.symmetry import turned
from app.evaluation.survey.world import SurveyScenario, fly_planner
from app.exploration.planner.options import PlannerOptions
from benchmarks.common.report import PLANNING, make_parser, write_section
from simulator.floors.terrain_files import load_terrain

SPACING_M, ALONG_M, DEPTH_M = 10.0, 0.5, 2.5


def compare(file: Path, seed: int, max_step_m: float) -> str:
    """Return a line of the table for one seed, which is the symmetry of the square as well."""
    terrain = turned(replace(load_terrain(file), name=file.stem), seed)
    scenario = SurveyScenario(terrain, 2, 500, max_step_m, "step", seed=seed, symmetry=seed)
    east, north = np.meshgrid(
        np.arange(SPACING_M / 2, terrain.width_m, SPACING_M), np.arange(ALONG_M / 2, terrain.height_m, ALONG_M)
    )
    log = scenario.log(2)
    log.sound(np.column_stack([east.ravel(), north.ravel(), np.full(east.size, DEPTH_M)]))
    lines = judge(scenario, log.soundings, np.zeros(1), yardstick=True)
    track = fly_planner(scenario, "cao", PlannerOptions())
    ours = judge(scenario, track.soundings, track.distance_m)
    return (
        f"lines {lines.rmse_m:.3f} m ({lines.samples} soundings), "
        f"ours {ours.rmse_m:.3f} m ({ours.samples}), ratio {ours.rmse_m / lines.rmse_m:.2f}"
    )


def main() -> None:
    """Run what the command line asks for."""
    parser = make_parser(__doc__, PLANNING, seeds=[0, 1, 2])
    parser.add_argument("terrain", type=Path)
    parser.add_argument("--max-step", type=float, default=2.5)
    options = parser.parse_args()
    figures = {}
    for seed in options.seeds:
        figures[f"seed {seed}"] = compare(options.terrain, seed, options.max_step)
        print(figures[f"seed {seed}"], flush=True)
    title = f"Few soundings beside a dense lawnmower, {options.terrain.stem}"
    write_section(options.write, PLANNING, title, figures, seeds=options.seeds, hidden={options.terrain: "TERRAIN.npz"})


if __name__ == "__main__":
    main()
