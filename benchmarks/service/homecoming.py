"""Whether everybody comes home: ``python -m benchmarks.service.homecoming [--missions 20 --at-once 4]``.

The missions of ``bathyfleet evaluate home``; what became of each vehicle is told for every mission as it ends.
"""

import asyncio
import json
import time
from collections.abc import Sequence

from app.commands.home import fly_all
from benchmarks.common.report import FLIGHT, make_parser, write_section


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--missions", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--at-once", type=int, default=4)
    parser.add_argument("--time-scale", type=float, default=60.0)
    parser.add_argument("--still", action="store_true", help="no current")
    options = parser.parse_args(arguments)
    seeds, begun = range(options.first, options.first + options.missions), time.monotonic()

    def told(mission: dict[str, object]) -> None:
        print(json.dumps(mission), flush=True)

    result = asyncio.run(fly_all(seeds, options.time_scale, options.at_once, told, still=options.still))
    result["wall_s"] = round(time.monotonic() - begun, 1)
    print(json.dumps(result, indent=2))
    title = f"Coming home, {'in still water' if options.still else 'in currents'}"
    write_section(options.write, FLIGHT, title, result, seeds=seeds)
    return 0 if result["home_pct"] == 100.0 else 1


if __name__ == "__main__":
    raise SystemExit(main())
