"""Reads one file and writes what it found; see ``app.missions.importing`` for the other side.

Arguments: the file, the task as JSON, the file to write. Exit code 3: the file cannot be used, stdout says why.
"""

import json
import resource
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

MAX_MEMORY_BYTES = 6 * 2**30
MAX_CPU_S = 120


def main() -> int:
    """Do what the arguments say."""
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY_BYTES, MAX_MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_CPU_S, MAX_CPU_S))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    path, task, out = Path(sys.argv[1]), json.loads(sys.argv[2]), Path(sys.argv[3])
    from app.mapping.readers.types import UNUSABLE, ReadError

    try:
        sys.stdout.write(json.dumps(_read(path, task, out)))
    except ReadError as error:
        sys.stdout.write(json.dumps({"field": error.field, "message": str(error), "remedy": error.remedy}))
        return UNUSABLE
    except MemoryError:
        words = {"field": "file", "message": "reading it takes too much memory", "remedy": "send a smaller one"}
        sys.stdout.write(json.dumps(words))
        return UNUSABLE
    return 0


def _read(path: Path, task: dict[str, Any], out: Path) -> dict[str, Any]:
    from app.mapping.georeference import LocalFrame
    from app.mapping.readers.files import read_file
    from app.mapping.readers.placing import place_reference, place_soundings
    from app.mapping.readers.types import Place, ReadOptions
    from app.mapping.types import Grid

    place = Place(LocalFrame(*task["origin"]), Grid(**task["grid"]), task["margin_m"])
    options = ReadOptions(**task["options"])
    content = read_file(path)
    if task["what"] == "reference":
        depths, notes = place_reference(content, options, place)
        np.save(out, depths, allow_pickle=False)
        return {"notes": notes}
    placed = place_soundings(content, options, place)
    np.save(out, np.column_stack(list(asdict(placed.soundings).values())), allow_pickle=False)
    return {"notes": placed.notes, "found": placed.found}


if __name__ == "__main__":
    sys.exit(main())
