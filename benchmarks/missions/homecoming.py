"""Whether everybody comes home: ``python -m benchmarks.missions.homecoming [--missions 20 --minutes 25]``.

The missions of ``bathyfleet evaluate home``; what became of each vehicle is told for every mission as it ends.
"""

import json
import math
import os
import time
from collections.abc import Sequence

from app.api import logs
from app.commands.home import fly_all
from benchmarks.common.report import FLIGHT, make_parser, write_section


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--missions", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--time-scale", type=float, default=20.0)
    parser.add_argument("--minutes", type=float, default=math.inf, help="of processor; no mission is begun after that")
    parser.add_argument("--still", action="store_true", help="no current")
    options = parser.parse_args(arguments)
    logs.configure("error", "json")
    seeds, begun = range(options.first, options.first + options.missions), time.monotonic()

    def told(mission: dict[str, object]) -> None:
        print(json.dumps(mission), flush=True)

    most_s = 60.0 * options.minutes
    result = fly_all(seeds, options.time_scale, told, still=options.still, most_s=most_s)
    result["wall_s"] = round(time.monotonic() - begun, 1)
    result["processor_s"] = round(time.process_time(), 1)
    result["load_of_the_machine"] = round(os.getloadavg()[1], 1)
    print(json.dumps(result, indent=2))
    title = f"Coming home, {'in still water' if options.still else 'in currents'}"
    write_section(options.write, FLIGHT, title, result, seeds=seeds[: result["missions"]])
    return 1 if result["wrong"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
