"""Whether everybody comes home: ``python -m benchmarks.missions.homecoming [--missions 20 --minutes 25]``.

The missions of ``bathyfleet evaluate home``; what became of each vehicle is told for every mission as it ends. With
``--keep FILE`` that is kept: the file's missions are not flown again as long as the program is the same, and the
figures are of all of them. A long run may be interrupted, and gone on with.
"""

import json
import math
import os
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from app.api import logs
from app.commands.home import fly_all, summary
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.missions.kept import keep, kept, version


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = make_parser(__doc__, FLIGHT)
    parser.add_argument("--missions", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--time-scale", type=float, default=20.0)
    parser.add_argument("--minutes", type=float, default=math.inf, help="of processor; no mission is begun after that")
    parser.add_argument("--still", action="store_true", help="no current")
    parser.add_argument("--keep", type=Path, help="keep what was flown in this file, and go on from it")
    parser.add_argument("--any-version", action="store_true", help="what other versions flew counts, too")
    options = parser.parse_args(arguments)
    logs.configure("error", "json")
    of, begun = version(), time.monotonic()
    done = kept(options.keep, None if options.any_version else of)
    flown = {mission["seed"] for mission in done}
    seeds = [seed for seed in range(options.first, options.first + options.missions) if seed not in flown]

    def told(mission: dict[str, object]) -> None:
        mission = {"version": of} | mission
        done.append(mission)
        keep(options.keep, mission)

    if seeds:
        fly_all(seeds, options.time_scale, told, still=options.still, most_s=60.0 * options.minutes)
    result = summary(done, still=options.still)
    result["missions_of_versions"] = dict(Counter(mission["version"] for mission in done))
    if seeds:
        # Of what was flown now.
        result["missions_now"] = len([mission for mission in done if mission["seed"] not in flown])
        result["wall_s"] = round(time.monotonic() - begun, 1)
        result["processor_s"] = round(time.process_time(), 1)
        result["load_of_the_machine"] = round(os.getloadavg()[1], 1)
    print(json.dumps(result, indent=2))
    title = f"Coming home, {'in still water' if options.still else 'in currents'}"
    of_all = sorted(mission["seed"] for mission in done)
    write_section(options.write, FLIGHT, title, result, seeds=of_all, hidden={options.keep: "FILE"})
    return 1 if result["wrong"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
