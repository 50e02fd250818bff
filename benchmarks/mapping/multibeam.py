"""How long reading a multibeam's file takes, and how much memory, in the process that imports are read by.

    python -m benchmarks.mapping.multibeam [--megabytes 100 1000 3000] [--formats gsf kmall] [--write]

A line of 60 pings of 400 soundings is repeated until the file has that size; all of it lies in an area of 1 km² with
cells of 1 m. KMALL has 120 bytes for each sounding, GSF 12 here. Files lie in a temporary folder while they are read.
"""

import asyncio
import resource
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.types import MapExtent, ReadOptions
from app.mapping.types import Grid
from app.missions.operations.imports.reader_process import Reader
from app.missions.operations.imports.uploads import open_upload
from benchmarks.common.report import LOAD, make_parser, write_section
from tests.support.mapping.multibeam import line, write_gsf, write_kmall

FRAME = LocalFrame(41.185, -8.704)
PLACE = MapExtent(FRAME, Grid(-500.0, -500.0, 1.0, 1000, 1000), 10.0)
WRITERS: dict[str, Callable[..., bytes]] = {"gsf": write_gsf, "kmall": write_kmall}
BEGIN_BYTES = {"gsf": 20, "kmall": 0}
"""What stands at a file's begin only."""


def fill(path: Path, kind: str, megabytes: int) -> None:
    """Write a file of about this size."""
    content = WRITERS[kind](path, line(FRAME, pings=60, beams=400))
    begin = BEGIN_BYTES[kind]
    with path.open("wb") as file:
        file.write(content[:begin])
        for _ in range(max(1, megabytes * 1_000_000 // (len(content) - begin))):
            file.write(content[begin:])


async def read(path: Path, kind: str) -> dict[str, float]:
    """Return what reading a file took; the memory is the most that a reading process of this run had."""
    upload = await asyncio.to_thread(open_upload, path)
    with upload.file:
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        found = await Reader().read(upload, f".{kind}", "soundings", PLACE, ReadOptions(sd_m=0.3))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        wall_s = time.perf_counter() - begin
    return {
        "million_soundings": round(found.found / 1e6, 1),
        "seconds": round(wall_s, 1),
        "cpu_s": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 1),
        "memory_mb": round(after.ru_maxrss / 1024),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the files and print what it took."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--megabytes", nargs="+", type=int, default=[100, 1000, 3000])
    parser.add_argument("--formats", nargs="+", choices=sorted(WRITERS), default=sorted(WRITERS))
    options = parser.parse_args(arguments)
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        for megabytes in options.megabytes:
            for kind in options.formats:
                path = Path(folder) / f"line.{kind}"
                fill(path, kind, megabytes)
                rows[f"{kind}, {megabytes} MB"] = asyncio.run(read(path, kind))
                print(f"{kind}, {megabytes} MB: {rows[f'{kind}, {megabytes} MB']}", flush=True)
                path.unlink()
    write_section(options.write, LOAD, "Files of multibeam sonars", rows)


if __name__ == "__main__":
    main()
