"""Planners beside lawnmower lines over a square, where each vehicle of a team flies a few lines: by error of the map.

    python -m benchmarks.planning.survey_teams [--planners cao,random] [--families slope,harbour] [--seeds 102 104 ...]
        [--vehicles 3] [--side 300] [--minutes 15] [--cell 5] [--step 20] [--write]

Missions are flown ahead as forecasts fly them (:mod:`app.missions.forecast.simulate`): by their own planners, decisions
and maps, vehicles steering in their turning circles through still water, nothing known of the floor before. Vehicles
begin in the south-western corner. Every planner flies over the same generated floors from the same starts, and so does
the planner ``lawnmower``, which uses nearly all of its way on even lines. The map at the end is the mission's own;
*error* is the root mean square of its difference to the true floor over all cells.

Told is the geometric mean of a planner's error over the lawnmower's, the standard error of that mean, the
worst floor and the best one, the same for each family, and how many metres a vehicle had left in the end on average.
Development uses even seeds; odd ones tell what it came to.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from app.api import logs
from app.exploration.planners import PLANNERS
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.gaussian_process.gp import warm_up
from app.missions.forecast.request import starts_of
from app.missions.forecast.simulate import fly, with_maps
from app.missions.forecast.swarm import StepFlown
from app.missions.maps.builder import MapBuilder
from app.missions.spec.mission import MissionSpec
from app.missions.team import Team
from benchmarks.common.names import named
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.imc.mission import ORIGIN
from simulator.floors.seafloors import FAMILIES, generate
from simulator.floors.terrain import Terrain

YARDSTICK = "lawnmower"
WITH_RELIEF = sorted(set(FAMILIES) - {"flat"})
MAX_DEPTH_M = 30.0


@dataclass(frozen=True)
class TeamSurvey:
    """A mission over a square but for its floor: vehicles, side, minutes at sea, longest leg, side of a cell."""

    vehicles: int = 3
    side_m: float = 300.0
    minutes: float = 15.0
    max_step_m: float = 20.0
    cell_m: float = 5.0

    def spec(self, planner: str, seed: int) -> MissionSpec:
        """Return the mission with a planner."""
        frame, side = LocalFrame(*ORIGIN), self.side_m
        corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side), (0.0, 0.0)]
        ring = [[float(x) for x in reversed(frame.to_geographic(*corner))] for corner in corners]
        return MissionSpec.model_validate(
            {
                "name": f"{planner} {seed}",
                "area": {"type": "Polygon", "coordinates": [ring]},
                "vehicles": [{"name": f"v{k}", "kind": "sim"} for k in range(self.vehicles)],
                "budget": {"minutes": self.minutes},
                "cell_m": self.cell_m,
                "limits": {"max_step_m": self.max_step_m, "max_depth_m": MAX_DEPTH_M},
                "planner": {"name": planner},
                "seed": seed,
            }
        )

    def floor(self, family: str, seed: int) -> Terrain:
        """Return a floor of the square's size."""
        return generate(family, seed, width_m=self.side_m, height_m=self.side_m, origin=ORIGIN)


@dataclass(frozen=True)
class Run:
    """What a planner came to over one floor: error of its map, and what each vehicle had left on average."""

    planner: str
    family: str
    seed: int
    rmse_m: float
    left_m: float


def flown(survey: TeamSurvey, planner: str, floor: Terrain, seed: int) -> tuple[MapBuilder, StepFlown]:
    """Fly a mission; return its map with the soundings, and how far vehicles came."""
    spec = survey.spec(planner, seed)
    team = Team()
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    starts, _ = starts_of(spec, members)
    builder = MapBuilder(spec.local_area(), spec.cell_m, spec.accuracy_m)
    builder.build()
    *_, last = with_maps(fly(spec, members, starts, builder, floor), builder)
    builder.learn(always=True)
    builder.build()
    return builder, last


def run(survey: TeamSurvey, planner: str, family: str, seed: int) -> Run:
    """Fly a mission over a floor and judge its map."""
    floor = survey.floor(family, seed)
    builder, last = flown(survey, planner, floor, seed)
    return Run(planner, family, seed, rmse_m(builder, floor), last.left_m / survey.vehicles)


def rmse_m(builder: MapBuilder, floor: Terrain) -> float:
    """Return how far the map is off over all cells, root mean square."""
    assert builder.newest is not None  # noqa: S101 - it was sounded
    depth_map = builder.newest.map
    centres = depth_map.grid.centres_m
    off = np.asarray(depth_map.depth_m).ravel() - floor.depth_at(centres[:, 0], centres[:, 1])
    return float(np.sqrt(np.nanmean(off**2)))


def figures(runs: Sequence[Run]) -> dict[str, str]:
    """Return each planner's errors over the lawnmower's over the same floors: of all, and family by family."""
    beside = {(one.family, one.seed): one for one in runs if one.planner == YARDSTICK}
    found = {}
    for planner in dict.fromkeys(one.planner for one in runs if one.planner != YARDSTICK):
        mine = [one for one in runs if one.planner == planner]
        for name, some in [("all floors", mine)] + [
            (family, [one for one in mine if one.family == family])
            for family in dict.fromkeys(one.family for one in mine)
        ]:
            pairs = [(one, beside[one.family, one.seed]) for one in some]
            left, left_beside = (np.mean([pair[k].left_m for pair in pairs]) for k in (0, 1))
            found[f"{planner}, {name}"] = (
                f"{ratio([one.rmse_m / other.rmse_m for one, other in pairs])}; "
                f"unflown {left:.0f} m a vehicle, {YARDSTICK} {left_beside:.0f} m"
            )
    return found


def ratio(ratios: Sequence[float]) -> str:
    """Return the geometric mean of some ratios with its standard error, and the greatest and the least of them."""
    logs_of = np.log(np.asarray(ratios, dtype=np.float64))
    mean = float(np.exp(logs_of.mean()))
    error = f" ± {mean * logs_of.std(ddof=1) / np.sqrt(len(logs_of)):.3f}" if len(logs_of) > 1 else ""
    return f"{mean:.3f}{error} of {len(ratios)}, worst {max(ratios):.2f}, best {min(ratios):.2f}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    given = TeamSurvey()
    parser = make_parser(__doc__, FLIGHT, seeds=range(102, 112, 2))
    parser.add_argument("--planners", default="cao", help="separated by commas")
    parser.add_argument("--families", default=",".join(WITH_RELIEF), help="of generated floors, separated by commas")
    parser.add_argument("--vehicles", type=int, default=given.vehicles)
    parser.add_argument("--side", type=float, default=given.side_m, help="of the square, metres")
    parser.add_argument("--minutes", type=float, default=given.minutes, help="at sea")
    parser.add_argument("--step", type=float, default=given.max_step_m, help="longest leg, metres")
    parser.add_argument("--cell", type=float, default=given.cell_m, help="of the map, metres")
    options = parser.parse_args(arguments)
    families = named(parser, "--families", options.families, FAMILIES)
    asked = named(parser, "--planners", options.planners, PLANNERS)
    logs.configure("error", "json")
    warm_up()
    survey = TeamSurvey(options.vehicles, options.side, options.minutes, options.step, options.cell)
    planners = [YARDSTICK, *(name for name in asked if name != YARDSTICK)]
    runs = []
    for seed in options.seeds:
        for family in families:
            for planner in planners:
                runs.append(run(survey, planner, family, seed))
                print(json.dumps(asdict(runs[-1])), flush=True)
    found = figures(runs)
    print("\n".join(f"{name}: {value}" for name, value in found.items()))
    title = f"Teams beside lawnmower lines: {survey.vehicles} x {survey.minutes:g} min over {survey.side_m:g} m"
    found["load_of_the_machine"] = f"{os.getloadavg()[2]:.1f}"
    write_section(options.write, FLIGHT, title, found, seeds=options.seeds)


if __name__ == "__main__":
    main()
