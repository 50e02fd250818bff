"""Puts a benchmark's figures into a page of results: one section each, which the next run replaces."""

import os
import re
import shlex
import sys
from pathlib import Path
from typing import Any

from app.evaluation.runs.facts import made

LOAD = Path(__file__).parents[1] / "docs" / "results" / "load.md"
LOAD_HEAD = """# Load and endurance: what was measured

Every section is written by the command that stands in it (`--write`). Service, vehicles and clients share the cores of
one machine, on which other programs may run beside: processor time and ratios say more than seconds by the clock. A
machine that was busy is told by `load_of_the_machine`, the mean number of programs that wanted a core: where that is
well above the number of cores, paces and times say nothing, and `service_cores` says what the service got.
"""

HEAD = """# The IMC bridge: what was measured

Every section is written by the command that stands in it (`--write` with this page's path). Vehicles are the
simulator's fake DUNE nodes on real UDP sockets of the same machine, which take part of its processor themselves.
"""


def command_line(hidden: dict[Path | None, str]) -> str:
    """How this program was called; paths of this machine by the names given."""
    words = [Path(sys.argv[0]).name, *sys.argv[1:]]
    shown = {str(path): name for path, name in hidden.items() if path is not None}
    return "python benchmarks/" + " ".join(shown.get(word, shlex.quote(word)) for word in words)


def write_section(
    page: Path, title: str, figures: dict[str, Any], hidden: dict[Path | None, str], *, head: str | None = None
) -> None:
    """Write the section ``title`` of a page, in the place of an older one; a new page begins with ``head``."""
    shown = f"docs/{page.as_posix().rpartition('docs/')[2]}" if "docs/" in page.as_posix() else page.name
    if page == LOAD:
        figures = figures | {"load_of_the_machine": round(os.getloadavg()[1], 1)}
    facts = made(command_line({page: shown, **hidden}), 1)
    lines = [f"## {title}", "", *(f"- {name}: {facts[name]}" for name in ("command", "date", "machine", "versions"))]
    lines += ["", "| | |", "| --- | --- |", *(f"| {name} | {_shown(value)} |" for name, value in figures.items()), ""]
    begin = head or (LOAD_HEAD if page == LOAD else HEAD)
    text = page.read_text(encoding="utf-8") if page.exists() else begin
    beginning, *sections = re.split(r"(?m)^(?=## )", text)
    kept = [section for section in sections if not section.startswith(f"## {title}\n")]
    place = next((i for i, section in enumerate(sections) if section.startswith(f"## {title}\n")), len(kept))
    kept.insert(place, "\n".join(lines))
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text("\n\n".join(part.strip() for part in (beginning, *kept)) + "\n", encoding="utf-8")


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name}: {_shown(item)}" for name, item in value.items()) or "none"
    if isinstance(value, list):
        return "; ".join(map(_shown, value)) or "none"
    return str(value).replace("|", "/").replace("\n", " ")
