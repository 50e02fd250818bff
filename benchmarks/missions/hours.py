"""Whether vehicles circle in missions of an hour: ``python -m benchmarks.missions.hours [--missions 10 --keep FILE]``.

What is flown is drawn by the mission's number: two to ten simulated vehicles, all at one depth or each at its own, some
with one of 2.5 m/s beside others of 1 m/s, over squares of 100 m to 1 km, each fifth of them a small one, in legs of 10
to 50 m; each third mission is flown by lines, the others by what the service has by default; each fifth over IMC, by
two fake DUNE nodes in processes of their own. The sea floor is the generated harbour, over IMC a smooth one. Told is
what :mod:`benchmarks.missions.flying` tells: ``loops_under_way`` are closed circles of vehicles that still had legs,
``loops_giving_way`` those of them that let another vehicle pass, ``loops_of_legs`` those that the legs describe.
With ``--keep FILE`` the missions are kept there, and are not flown again as long as the program is the same. With
``--simulated-time`` those over IMC are left out, and the others are flown as fast as the machine allows, however busy
it is: no decision takes time then.
"""

import asyncio
import json
import os
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from app.api import logs
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.missions.flying import Flight, fly, fly_in_simulated_time
from benchmarks.missions.kept import keep, kept, version

SHORT_M = 150.0
"""Areas with a side below this are the small ones."""


def drawn(seed: int, minutes: float, time_scale: float) -> Flight:
    """Return what the mission of a number is."""
    rng = np.random.default_rng([41, seed])
    side = float(round(100.0 * 10.0 ** rng.uniform(0.0, 0.15 if seed % 5 == 1 else 1.0)))
    vehicles = int(rng.integers(2, min(10, 2 + round(side / 80.0)) + 1))
    leg = float(rng.choice([leg for leg in (10.0, 20.0, 50.0) if leg <= side / 5.0]))
    flight = Flight(
        vehicles=vehicles,
        side=side,
        minutes=minutes,
        leg=leg,
        speeds=(2.5, *[1.0] * (vehicles - 1)) if rng.random() < 0.3 else (),
        time_scale=time_scale,
        planner="lawnmower" if seed % 3 == 2 else "cao",
        seed=seed,
        layers_m=float(rng.choice([0.0, 1.0])),
    )
    return replace(flight, vehicles=2, speeds=(), kind="imc") if seed % 5 == 4 else flight


def main(arguments: Sequence[str] | None = None) -> None:
    """Fly and print."""
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--missions", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--time-scale", type=float, default=10.0)
    parser.add_argument("--keep", type=Path, metavar="FILE", help="keep what was flown in this file, and go on from it")
    parser.add_argument("--simulated-time", action="store_true", help="as fast as the machine allows, none over IMC")
    parser.add_argument("--any-version", action="store_true", help="what other versions flew counts, too")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="draw the tracks into this folder")
    options = parser.parse_args(arguments)
    logs.configure("error", "json")
    of = version()
    done = {mission["seed"]: mission for mission in kept(options.keep, None if options.any_version else of)}
    for seed in range(options.first, options.first + options.missions):
        if seed in done:
            continue
        flight = drawn(seed, options.minutes, options.time_scale)
        if options.simulated_time and flight.kind == "imc":
            continue
        picture = None if options.pictures is None else options.pictures / f"{seed}.png"
        if options.simulated_time:
            found = fly_in_simulated_time(flight, picture)
        else:
            with tempfile.TemporaryDirectory(prefix="bathyfleet-hours-") as folder:
                found = asyncio.run(fly(flight, Path(folder), picture))
        load = round(os.getloadavg()[1], 1)
        facts = {"version": of, "seed": seed, "flight": describe(flight), "side_m": flight.side, "load": load}
        done[seed] = facts | found
        keep(options.keep, done[seed])
    flown = [done[seed] for seed in sorted(done) if 0 <= seed - options.first < options.missions]
    figures = summary(flown)
    print(json.dumps(figures, indent=1))
    title = f"Missions of {options.minutes:g} min{' in simulated time' if options.simulated_time else ''}"
    hidden = {options.keep: "FILE", options.pictures: "FOLDER"}
    write_section(options.write, FLIGHT, title, figures, seeds=[m["seed"] for m in flown], hidden=hidden)


def describe(flight: Flight) -> str:
    """Return a mission in words."""
    depth = "each at its depth" if flight.layers_m else "at one depth"
    speeds = ", one of 2.5 m/s beside others of 1 m/s" if flight.speeds else ""
    team = f"{flight.vehicles} vehicles ({flight.kind}) {depth}{speeds}"
    return f"{flight.planner}, {team}, {flight.side:g} m, legs of {flight.leg:g} m"


def summary(flown: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return what all missions came to, and each."""
    figures: dict[str, Any] = {"missions": len(flown)}
    figures["missions_of_versions"] = dict(Counter(mission["version"] for mission in flown))
    for key in ("loops_under_way", "loops_giving_way", "loops_of_legs", "loops", "missed"):
        figures[key] = sum(mission[key] for mission in flown)
    figures["vehicle_hours"] = round(sum(vehicle["hours"] for m in flown for vehicle in m["by_vehicle"].values()), 1)
    for name, some in (
        ("large", [mission for mission in flown if mission["side_m"] >= SHORT_M]),
        ("small", [mission for mission in flown if mission["side_m"] < SHORT_M]),
    ):
        if some:
            figures[f"least_on_plan_pct_{name}"] = min(mission["on_plan_pct"] for mission in some)
    for mission in flown:
        figures[f"{mission['seed']}: {mission['flight']}"] = (
            f"{mission['on_plan_pct']} % on plan, {mission['loops_under_way']} circles under way "
            f"({mission['loops_giving_way']} to let another one pass, {mission['loops_of_legs']} by its legs), "
            f"{mission['loops'] - mission['loops_under_way']} at the end, {mission['waiting_pct']} % in them, "
            f"{mission['missed']} legs missed, load {mission['load']}"
        )
    return figures


if __name__ == "__main__":
    main()
