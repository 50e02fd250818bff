"""What files of very many soundings cost: ``python -m benchmarks.service.exporting [--soundings 2000000]``.

A database is filled, then each file is made by the command line in a process of its own. Told are its bytes, the
processor's seconds and the most memory that the process had; ``start`` is the same command for a file of nothing, the
tracks. ``--before TREE`` compares with the program of another work tree. Printed is one JSON object.
"""

import json
import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.opening import filled
from tests.support.paths import PROJECT

FILES = {
    "start": ("tracks.geojson",),
    "soundings.csv": ("soundings.csv",),
    "soundings.xyz": ("soundings.xyz",),
    "soundings.geojson": ("soundings.geojson", "--vehicle", "multi-0"),
}


PROGRAM = """
import atexit, pathlib, sys
sys.path[0] = {tree!r}
atexit.register(lambda: pathlib.Path({status!r}).write_bytes(pathlib.Path("/proc/self/status").read_bytes()))
from app.cli import main
main()
"""


def exported(tree: Path, folder: Path, mission: str, words: tuple[str, ...]) -> dict[str, Any]:
    """What one file costs. Raises CalledProcessError where it is not made."""
    with tempfile.TemporaryDirectory() as place:
        out, status = Path(place) / "file", Path(place) / "status"
        program = PROGRAM.format(tree=str(tree.resolve()), status=str(status))
        options = ["-o", str(out), "--database", f"sqlite+aiosqlite:///{folder / 'service.db'}"]
        provider = {"organization": "Harbour", "email": "map@example.org"}
        variables = os.environ | {f"BATHYFLEET_PROVIDER__{name.upper()}": text for name, text in provider.items()}
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-c", program, "export", mission, "-f", *words, *options]
        subprocess.run(command, env=variables, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        [peak_kib] = re.findall(r"VmHWM:\s+(\d+) kB", status.read_text())
        return {
            "megabytes": round(out.stat().st_size / 1e6, 1),
            "processor_s": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 1),
            "memory_mb": round(int(peak_kib) * 1024 / 1e6),
        }


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--soundings", type=int, default=2_000_000)
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where the filled database is, or is left")
    parser.add_argument("--before", type=Path, metavar="TREE", help="compare with the program in another work tree")
    options = parser.parse_args()
    trees = {"before": options.before} if options.before else {}
    with filled(options) as (folder, mission):
        result = {
            name: {
                version: exported(tree, folder, mission, words) for version, tree in (trees | {"now": PROJECT}).items()
            }
            for name, words in FILES.items()
        }
    print(json.dumps(result))
    title = f"Files of {options.soundings:,} soundings".replace(",", " ")
    write_section(options.write, LOAD, title, result, hidden={options.before: "BEFORE", options.keep: "FOLDER"})


if __name__ == "__main__":
    main()
