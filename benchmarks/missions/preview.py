"""How long plans take that are drawn while a mission is described: ``python -m benchmarks.missions.preview``.

Squares of 100 m to 1 km, 2 and 4 simulated vehicles, without and with a keep-out zone in the middle, by the planners
that an operator chooses from. Told is the processor's time in milliseconds of one plan, the median of ``--repeats``
after one that compiles, of each planner the slowest one, and the way of all plans in metres, which shows whether other
plans are made than before. ``--before TREE`` takes turns with the program in another work tree.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.common.report import LOAD, make_parser, write_section

PLANNERS = ("cao", "lawnmower", "swath")
MINUTES = {100.0: 30.0, 300.0: 90.0, 1000.0: 240.0}
VEHICLES = (2, 4)
ZONES = (False, True)
FAR_M = 40.0
"""Where the recovery point lies west of the area."""


def described(planner: str, side_m: float, vehicles: int, *, zone: bool) -> dict[str, Any]:
    from tests.support.missions.specs import lon_lat, rectangle

    sensor = "multibeam" if planner == "swath" else "single_beam"
    return {
        "name": "preview",
        "area": rectangle(0, 0, side_m, side_m),
        "keep_out": [rectangle(0.4 * side_m, 0.35 * side_m, 0.6 * side_m, 0.55 * side_m)] if zone else [],
        "vehicles": [{"name": f"v{k}", "kind": "sim", "sensor": sensor} for k in range(vehicles)],
        "planner": {"name": planner},
        "budget": {"minutes": MINUTES[side_m]},
        "cell_m": 1.0,
        "recovery": {"point": list(lon_lat(-FAR_M, 0.5 * side_m))},
    }


def measure(repeats: int, planners: list[str]) -> dict[str, dict[str, float]]:
    """Return the processor's milliseconds and the metres of each plan, by what was planned."""
    from app.missions.forecast.plan import plan
    from app.missions.forecast.preview import BUDGET_S
    from app.missions.forecast.request import starts_of
    from app.missions.spec.mission import MissionSpec
    from app.missions.team import Team

    found = {}
    for planner in planners:
        for side_m in MINUTES:
            for vehicles in VEHICLES:
                for zone in ZONES:
                    spec = MissionSpec.model_validate(described(planner, side_m, vehicles, zone=zone))
                    team = Team()
                    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
                    took_ms = []
                    for _ in range(1 + repeats):
                        begun = time.process_time()
                        made = plan(spec, members, starts_of(spec, members)[0], budget_s=BUDGET_S)
                        took_ms.append(1000.0 * (time.process_time() - begun))
                    name = f"{planner}, {side_m:g} m, {vehicles} vehicles{', zone' if zone else ''}"
                    found[name] = {
                        "ms": round(median(took_ms[1:]), 0),
                        "metres": round(sum(way.distance_m for way in made.ways)),
                        "whole": made.whole,
                        "own": made.own,
                    }
                    print(name, found[name], file=sys.stderr, flush=True)
    return found


def in_tree(tree: Path, options: argparse.Namespace) -> dict[str, dict[str, float]]:
    """Measure with the program of a work tree, in a process of its own."""
    here = str(Path(__file__).resolve())
    begin = (
        f"import sys; sys.path.insert(0, {str(tree.resolve())!r}); import json, runpy; "
        f"space = runpy.run_path({here!r}, run_name='preview'); "
        f"print(json.dumps(space['measure']({options.repeats}, {options.planners!r})))"
    )
    done = subprocess.run([sys.executable, "-c", begin], stdout=subprocess.PIPE, check=True, text=True, cwd=tree)
    return json.loads(done.stdout)  # type: ignore[no-any-return]


def slowest(found: dict[str, dict[str, float]], planner: str) -> float:
    """Return the milliseconds of a planner's slowest plan."""
    return max(one["ms"] for name, one in found.items() if name.startswith(f"{planner},"))


def main() -> None:
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--planners", nargs="+", default=list(PLANNERS))
    parser.add_argument("--before", type=Path, metavar="TREE", help="compare with the program in another work tree")
    options = parser.parse_args()
    now = measure(options.repeats, options.planners)
    if options.before is None:
        result: dict[str, Any] = {name: f"{one['ms']:.0f} ms, {one['metres']} m" for name, one in now.items()}
        result |= {f"slowest of {planner}": f"{slowest(now, planner):.0f} ms" for planner in options.planners}
    else:
        before = in_tree(options.before, options)
        result = {
            name: f"{before[name]['ms']:.0f} -> {one['ms']:.0f} ms, {one['ms'] / max(before[name]['ms'], 1):.2f} "
            f"of it; {before[name]['metres']} -> {one['metres']} m"
            for name, one in now.items()
        }
        result |= {
            f"slowest of {planner}": f"{slowest(before, planner):.0f} -> {slowest(now, planner):.0f} ms"
            for planner in options.planners
        }
    print(json.dumps(result, indent=2))
    write_section(options.write, LOAD, "Plans drawn before the start", result, hidden={options.before: "BEFORE"})


if __name__ == "__main__":
    main()
