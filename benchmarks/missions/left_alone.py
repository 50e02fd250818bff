"""Whether vehicles come home without the service: ``python -m benchmarks.missions.left_alone [--seeds 0 1 …]``.

For each seed the real service, a process of its own, leads two fake DUNE nodes on UDP sockets of this machine, which
run ``Supervisors/AUV/LostComms``; it is killed (SIGKILL) at a moment drawn by the seed and not started again. A
vehicle is home when its stored plan has brought it within 25 m of its recovery point and to the surface. Printed is
one JSON object for each kill and one for all; ``--write`` puts that into a page. Exit code 1 when a vehicle is not
home, a keep-out zone was entered, or two were closer than the mission keeps them apart.
"""

import argparse
import asyncio
import json
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.common.report import make_parser, write_section
from benchmarks.service.faults import PAGE
from tests.support.faults.left_alone import left_alone
from tests.support.faults.sea import NAMES


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = make_parser(__doc__, PAGE, seeds=range(20))
    parser.add_argument("--speed", type=float, default=20.0, help="vehicle seconds per second")
    parser.add_argument("--timeout", type=float, default=300.0, help="of LostComms, vehicle seconds")
    parser.add_argument("--current", type=float, default=0.0, help="speed of the current, m/s")
    parser.add_argument("--at-once", type=int, default=1, help="kills that are played at the same time")
    options = parser.parse_args(arguments)
    begun = time.monotonic()
    kills = asyncio.run(play(options))
    result = summary(kills) | {"current_mps": options.current, "wall_s": round(time.monotonic() - begun)}
    print(json.dumps(result, indent=2))
    title = f"The service is killed and does not return, {'in a current' if options.current else 'in still water'}"
    write_section(options.write, PAGE, title, result, seeds=options.seeds)
    everybody = result["vehicles_home"] == result["vehicles"]
    return 0 if everybody and not result["zones_entered"] and not result["too_close"] else 1


async def play(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Kill the service once for each seed; what became of the vehicles each time."""
    room = asyncio.Semaphore(options.at_once)

    async def one(seed: int) -> dict[str, Any]:
        async with room:
            with tempfile.TemporaryDirectory(prefix="bathyfleet-left-alone-") as folder:
                found = await left_alone(
                    Path(folder),
                    seed=seed,
                    speed=options.speed,
                    timeout_s=options.timeout,
                    current_mps=options.current,
                )
        print(json.dumps(found), flush=True)
        return found

    return await asyncio.gather(*(one(seed) for seed in options.seeds))


def summary(kills: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What became of the vehicles of all kills together."""
    times = [s for kill in kills for s in kill["home_after_s"] if s is not None]
    return {
        "kills": len(kills),
        "all_home": sum(kill["home"] == len(NAMES) for kill in kills),
        "vehicles": len(NAMES) * len(kills),
        "vehicles_home": sum(kill["home"] for kill in kills),
        "ways_on_board_when_killed": sum(kill["kept_on_board"] for kill in kills),
        "home_before": sum(kill["home_before"] for kill in kills),
        "farthest_when_killed_m": max(m for kill in kills for m in kill["from_home_when_killed_m"]),
        "worst_from_point_m": max(m for kill in kills for m in kill["from_point_m"]),
        "latest_home_after_s": max(times, default=None),
        "least_energy_pct": min(kill["least_energy_pct"] for kill in kills),
        "zones_entered": sum(kill["zones_entered"] for kill in kills),
        "closest_m": min(kill["closest_m"] for kill in kills),
        "too_close": sum(kill["too_close"] for kill in kills),
        "collided": sum(kill["collided"] for kill in kills),
    }


if __name__ == "__main__":
    raise SystemExit(main())
