"""Results on disk, one JSON object per line: every run is kept as soon as it is done."""

from pathlib import Path
from typing import Any

import orjson


class Results:
    """Runs by key; opening an existing file takes up what it holds, so that an interrupted evaluation goes on."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self.runs: dict[str, dict[str, Any]] = {}
        if not file.is_file():
            return
        whole = file.read_bytes()
        for line in whole.splitlines():
            try:
                run = orjson.loads(line)
            except orjson.JSONDecodeError:
                continue  # the last line of an evaluation that was killed while writing
            self.runs[run["key"]] = run
        if whole and not whole.endswith(b"\n"):
            with file.open("ab") as out:
                out.write(b"\n")

    def add(self, run: dict[str, Any]) -> None:
        """Keep a run."""
        self.runs[run["key"]] = run
        with self._file.open("ab") as out:
            out.write(orjson.dumps(run) + b"\n")
