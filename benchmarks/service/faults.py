"""What goes wrong at sea, at length: ``python -m benchmarks.service.faults [SCENE …] [--write]``.

The scenes of ``tests/faults`` with the real service as a process of its own: killed again and again, without room on
its disk, locked out of its database, with a clock that jumps, a network that loses and delays, vehicles that lie
or vanish, another service beside it, a cut network. Each asserts that no accepted sounding is lost, that every
waypoint lies in the area, that no order comes twice, and that the operator is told. Printed is one JSON object for each
scene; ``--write`` puts it into a page. A scene that does not hold ends the command with exit code 1.
"""

import asyncio
import json
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Coroutine
from itertools import product
from pathlib import Path
from typing import Any

from benchmarks.common.report import Page, make_parser, write_section
from tests.support.faults import imc_scenes, scenes
from tests.support.faults.disks import small_disk

PAGE = Page(
    "faults.md",
    """# Faults: what was tried

Every section is written by the command that stands in it (`--write`). The service runs as a
process of its own with the database it has in the field; polling vehicles repeat what was not answered, IMC vehicles
are the simulator's fake DUNE nodes. In every scene it is asserted that no accepted sounding is lost or stored twice,
that every waypoint lies in the area, that no vehicle is sent to an earlier step again, and that log and page say why.
`load_of_the_machine` is the mean number of programs that wanted one of its cores, the scene's own among them.
""",
    timed=True,
)

Scene = Callable[[Path, int], Coroutine[Any, Any, dict[str, Any]]]


async def killed(folder: Path, seed: int) -> dict[str, Any]:
    """50 kills in 500 steps."""
    return await scenes.killed_again_and_again(folder, kills=50, steps=500, seed=seed)


async def full(folder: Path, _seed: int) -> dict[str, Any]:
    """A disk that is full ten times."""
    with small_disk(folder / "disk") as disk:
        return await scenes.disk_full(folder, disk, steps=250, fills=10)


async def locked(folder: Path, _seed: int) -> dict[str, Any]:
    """A lock that is held longer than a writer waits by default."""
    return await scenes.locked(folder, steps=120, locks=2, busy_ms=30_000)


async def aborted(folder: Path, _seed: int) -> dict[str, Any]:
    """An abort while the disk is full."""
    with small_disk(folder / "disk") as disk:
        return await scenes.aborted_without_a_disk(folder, disk)


async def clock(folder: Path, _seed: int) -> dict[str, Any]:
    """A clock that is set by seconds and by years."""
    return await scenes.clock_jumps(folder, [5.0, -5.0, 3600.0, -86_400.0, 1e9, -1e9, 0.0])


async def lies(folder: Path, _seed: int) -> dict[str, Any]:
    """A polling vehicle that lies."""
    return await scenes.lied_to(folder, steps=60)


async def radio(folder: Path, _seed: int) -> dict[str, Any]:
    """A bad radio, in the vehicles' own time: 2 s are 2 s."""
    return await imc_scenes.bad_radio(folder, steps=10, speed=1.0)


async def imc_lies(folder: Path, _seed: int) -> dict[str, Any]:
    """An IMC vehicle that lies."""
    return await imc_scenes.lied_to_over_imc(folder, steps=40, speed=10.0)


async def vanished(folder: Path, _seed: int) -> dict[str, Any]:
    """A vehicle that is gone for a while."""
    return await imc_scenes.vanished(folder, steps=40, speed=10.0)


async def two(folder: Path, _seed: int) -> dict[str, Any]:
    """Two services on one network."""
    return await imc_scenes.two_services(folder, steps=20, speed=10.0)


async def cut(folder: Path, _seed: int) -> dict[str, Any]:
    """A network that is cut three times."""
    return await imc_scenes.cut_in_two(folder, steps=20, cuts=3, speed=10.0)


SCENES: dict[str, tuple[str, Scene]] = {
    "kill": ("Killed 50 times in 500 steps", killed),
    "full": ("The disk is full, ten times", full),
    "locked": ("Another program holds the database locked", locked),
    "abort": ("Aborted while nothing can be written", aborted),
    "clock": ("The clock jumps", clock),
    "lies": ("A polling vehicle posts what cannot be", lies),
    "radio": ("UDP with 30 % loss, doubled and reordered packets and 2 s of delay", radio),
    "imc-lies": ("An IMC vehicle reports what cannot be", imc_lies),
    "vanish": ("A vehicle vanishes and returns", vanished),
    "two": ("Two services on one network", two),
    "cut": ("The network is cut in two, three times", cut),
}


def main() -> None:
    """Play and print; exit code 1 when a scene did not hold."""
    parser = make_parser(__doc__, PAGE, seeds=[2026])
    parser.add_argument("scene", nargs="*", choices=[*SCENES, []], help="which ones; without any: all")
    options = parser.parse_args()
    broken = 0
    for name, seed in product(options.scene or SCENES, options.seeds):
        title, scene = SCENES[name]
        begun = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="bathyfleet-faults-") as folder:
            try:
                result = asyncio.run(scene(Path(folder), seed))
            except (AssertionError, TimeoutError):
                traceback.print_exc()
                broken += 1
                continue
        result["wall_s"] = round(time.monotonic() - begun)
        print(json.dumps({"scene": name} | result), flush=True)
        write_section(options.write, PAGE, title, result, seeds=[seed])
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
