"""Missions that were flown by long benchmarks, kept in a file of JSON lines: an interrupted run goes on from there."""

import json
import subprocess
from pathlib import Path
from typing import Any

from tests.support.paths import PROJECT

PROGRAM = ("app", "simulator")
"""What is flown, and flies."""


def version() -> str:
    """Return what tells versions of the program apart, that of the documentation aside."""
    asked = ["git", "rev-parse", *(f"HEAD:{folder}" for folder in PROGRAM)]
    trees = subprocess.run(asked, cwd=PROJECT, check=True, capture_output=True, text=True).stdout.split()
    return "-".join(tree[:10] for tree in trees)


def kept(file: Path | None, of: str | None) -> list[dict[str, Any]]:
    """Return the missions of a file that were flown by this version, None: by any; of a seed's the last."""
    lines = [] if file is None or not file.exists() else file.read_text(encoding="utf-8").splitlines()
    found = {mission["seed"]: mission for mission in map(json.loads, lines) if of in (None, mission["version"])}
    return list(found.values())


def keep(file: Path | None, mission: dict[str, Any]) -> None:
    """Print a mission that was flown, and add it to the file, if there is one."""
    line = json.dumps(mission)
    print(line, flush=True)
    if file is not None:
        with file.open("a", encoding="utf-8") as lines:
            lines.write(f"{line}\n")
