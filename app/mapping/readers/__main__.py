"""Reads one file, locked in; see ``app.missions.operations.imports.reader_process`` for the other side.

The file is standard input. Arguments: the task as JSON, and the number of the open file for the values found. What was
found is said as JSON on standard output, in one line. Exit code 3: the file cannot be used, and why; 4: this system
cannot lock the process in.
"""

import json
import sys
from typing import Any

from app.mapping.readers.confinement import LAYERS, ResourceLimits, confine, limit
from app.mapping.readers.types import UNCONFINED, UNUSABLE, ReadError

LIMITS = ResourceLimits(memory_bytes=4 * 2**30, cpu_s=120, file_bytes=2**30)


def main(layers: tuple[str, ...] = LAYERS) -> int:
    """Do what the arguments say, with these layers of confinement."""
    task, result = json.loads(sys.argv[1]), int(sys.argv[2])
    limit(LIMITS)
    # pyogrio would load it, and it starts threads.
    sys.modules["pyarrow"] = None  # type: ignore[assignment]
    # Everything is imported and used once before the file is looked at: afterwards nothing more can be loaded.
    from app.mapping.readers.placed_file import place_file
    from app.mapping.readers.warm_up import data_folders, warm_up

    warm_up(task)
    held = confine([result], data_folders(), layers)
    words: dict[str, Any] = {"confined": held}
    if not task["unconfined"] and held["landlock"] and held["seccomp"]:
        sys.stdout.write(json.dumps(words))
        return UNCONFINED
    try:
        with open(result, "wb", closefd=False) as out:
            words |= place_file(sys.stdin.buffer, task, out)
    except ReadError as error:
        words |= {"field": error.field, "message": str(error), "remedy": error.remedy}
    except MemoryError:
        words |= {"field": "file", "message": "reading it takes too much memory", "remedy": "send a smaller one"}
    sys.stdout.write(json.dumps(words))
    return UNUSABLE if "remedy" in words else 0


if __name__ == "__main__":
    sys.exit(main())
