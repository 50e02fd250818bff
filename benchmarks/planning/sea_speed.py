"""How much quicker than real time surveys at sea are simulated: ``python -m benchmarks.planning.sea_speed [--write]``.

Three vehicles over the demonstration's harbour for 10 and 30 minutes, led by the default planner and by the lawnmower,
then everything that ``bathyfleet evaluate survey --dynamics`` flies and maps in one run. By processor time, after a
short flight that has everything compiled.
"""

import os
import time
from collections.abc import Callable
from functools import partial

from app.evaluation.survey.dynamics import fly_planner_at_sea
from app.evaluation.survey.run import run_survey_at_sea
from app.evaluation.survey.world import SPEED_MPS, SurveyScenario
from app.exploration.planner.options import PlannerOptions
from benchmarks.common.report import FLIGHT, make_parser, write_section
from simulator.floors.seafloors import generate

VEHICLES, STEP_M = 3, 10.0
MINUTES = (10.0, 30.0)
WARM_UP_MINUTES = 4.0


def scenario_of(minutes: float, seed: int) -> SurveyScenario:
    """Return a survey of so many minutes."""
    steps = round(60.0 * minutes * SPEED_MPS / STEP_M)
    return SurveyScenario(generate("harbour", seed), VEHICLES, steps, STEP_M, "continuous", seed=seed)


def times_real_time(fly: Callable[[], object], minutes: float) -> str:
    """Return what is written of a flight of so many simulated minutes."""
    begun_s = time.process_time()
    fly()
    took_s = time.process_time() - begun_s
    return f"{60.0 * minutes / took_s:.0f} x real time, {took_s:.1f} s of processor"


def main() -> None:
    """Run what the command line asks for."""
    given = make_parser(__doc__, FLIGHT, seeds=[0]).parse_args()
    seed, options, found = given.seeds[0], PlannerOptions(), {}
    fly_planner_at_sea(scenario_of(WARM_UP_MINUTES, seed), "cao", options, WARM_UP_MINUTES)
    for minutes in MINUTES:
        how = options, minutes
        for planner in ("cao", "lawnmower"):
            name = f"{planner}, {minutes:.0f} minutes"
            found[name] = times_real_time(
                partial(fly_planner_at_sea, scenario_of(minutes, seed), planner, *how), minutes
            )
    name = f"cao with all that it is compared with, {minutes:.0f} minutes"
    found[name] = times_real_time(partial(run_survey_at_sea, scenario_of(minutes, seed), "cao", *how), minutes)
    print("\n".join(f"{name}: {value}" for name, value in found.items()))
    found["load_of_the_machine"] = f"{os.getloadavg()[1]:.1f}"
    write_section(given.write, FLIGHT, "Surveys at sea: simulated time", found, seeds=[seed])


if __name__ == "__main__":
    main()
