"""What every benchmark has in common: its options, the facts of a run, and pages of results."""

import argparse
import os
import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.evaluation.runs.facts import made
from tests.support.paths import PROJECT


@dataclass(frozen=True)
class Page:
    """A page of results: its name below ``docs/results``, what stands above its sections, whether the clock matters."""

    name: str
    head: str = ""
    timed: bool = False

    @property
    def path(self) -> Path:
        """Where it is written unless something else is asked for."""
        return PROJECT / "docs" / "results" / self.name


LOAD = Page(
    "load.md",
    """# Load and endurance: what was measured

Every section is written by the command that stands in it (`--write`). Service, vehicles and clients share the cores of
one machine, on which other programs may run beside: processor time and ratios say more than seconds by the clock. A
machine that was busy is told by `load_of_the_machine`, the mean number of programs that wanted a core: where that is
well above the number of cores, paces and times say nothing, and `service_cores` says what the service got.
""",
    timed=True,
)
IMC = Page(
    "imc.md",
    """# The IMC bridge: what was measured

Every section is written by the command that stands in it (`--write`). Vehicles are the simulator's fake DUNE nodes on
real UDP sockets of the same machine, which take part of its processor themselves. `load_of_the_machine` is the mean
number of programs that wanted one of its cores.
""",
    timed=True,
)
FLIGHT = Page(
    "flight.md",
    """# Flying: what was measured

Every section is written by the command that stands in it (`--write`). Vehicles are simulated; service and vehicles
share the cores of one machine. `loops` and `waiting_pct` count the circles of vehicles that give way, too, and of those
that have flown their way and wait for the others, as nobody told them where home is; `loops_under_way` and
`waiting_under_way_pct` are without the latter.
""",
)
COVERAGE = Page(
    "coverage.md",
    """# Full coverage with swath sonars: what was measured

Every section is written by the command that stands in it (`--write`). Simulated time, no network; turns are flown, and
the team's kilometres count from its start in the south-western corner. Each leg is decided 2.5 s before the last one
ends. It is kinder than the sea: vehicles fly exactly where they are sent, nothing drifts, and every beam within range
and aperture detects the bottom. Beams are evenly spaced on a flat bottom, and the speed lets two pings meet each cell.
The floors called *own*, and seeds 0 and 1 of the *unseen* ones, were looked at while the planner was made.
Teams of one and two over the *own* floors are of 26 November, the *unseen* ones a day older: single rows have changed
since, in both directions. The *large* floors were not run as a set: see [trials](trials.md#full-coverage).
""",
)
ADJUSTMENT = Page(
    "adjustment.md",
    """# Adjusted tracks: what was measured

Every section is written by the command that stands in it (`--write`). Two simulated vehicles, 3 m above the bottom,
survey the floor on lines and crosslines (swath sonars of 120 degrees with 40 % overlap, or single beams on lines 5 m
apart), with a GPS fix of 0.3 m at both ends of the dive. Their positions drift until then: a rate that changes
slowly, a random walk, and a wrong heading. The simulated drift is of the same kind as the one that the adjustment
assumes. Figures are after over before, where before is by reckoned positions: fixes alone make part of it. The *own*
floors monterey_canyon, fortbragg_gully, fortbragg_plateau, jd211_pit and leixoes_sharp_diagonal were looked at while
the adjustment was made, and a generated flat one that is not listed.
""",
)
LANDMARKS = Page(
    "landmarks.md",
    """# Landmarks of the papers' scenario: whether what is claimed of them holds

Every section is written by the command that stands in it (`--write`); what is measured stands at the head of
`benchmarks/planning/landmarks.py`. Even seeds were looked at while the estimator was made, so were the real floors and
the generated *rugged* and *ridge* of seed 1, flown with even seeds. Runs are chaotic: t99 of one and the same floor
differs by a tenth from seed to seed.
""",
)
SITES = Page(
    "sites.md",
    """# Sites: changes between surveys, what was measured

Every section is written by the command that stands in it (`--write`). Generated floors, single beams along lines that
cross those of the other survey; positions, water level and sound speed are exact. *false* is the share of unchanged
ground that is called changed at 95 % (5 % where deviations are right, less where they are wide), *found* the share of
changed ground that is called so with the right sign, *volume* how far the net volume is off in its own standard
deviations (RMS). Half of the pit's rim lies between lines: not all of it can be found.
""",
)
PATCH_TEST = Page(
    "patch-test.md",
    """# Patch test: what was measured

Every section is written by the command that stands in it (`--write`). Eight lines over generated floors, by the
simulator's multibeam. *drawn*: the sonar is mounted otherwise than is stated; *right*: as is stated, where nothing
should be proposed. *off* is the error of what was determined (RMS), also in the deviations that were told with it.
""",
)
PLANNING = Page(
    "planning.md",
    """# Planners: what was measured

Every section is written by the command that stands in it (`--write`).
""",
)


ROW = 20
"""So many seeds one after the other are told one by one."""


def make_parser(doc: str | None, page: Page, *, seeds: Sequence[int] | None = None) -> argparse.ArgumentParser:
    """Options that all have: ``--write``, and ``--seeds`` for what is drawn at random."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    shown = f"docs/results/{page.name}"
    parser.add_argument("--write", nargs="?", type=Path, const=page.path, metavar="PAGE", help=f"write {shown}")
    if seeds is not None:
        parser.add_argument("--seeds", nargs="+", type=int, default=list(seeds), help="one run for each")
    return parser


def command_line(hidden: Mapping[Path | None, str] | None = None) -> str:
    """How this program was called; paths of this machine by the names given."""
    spec = sys.modules["__main__"].__spec__
    module = spec.name if spec is not None else Path(sys.argv[0]).stem
    shown = {str(path): name for path, name in (hidden or {}).items() if path is not None}
    words = [shown.get(word, shlex.quote(word)) for word in sys.argv[1:]]
    return " ".join(["python -m", module, *words])


def facts(
    *,
    seeds: Sequence[int] | None = None,
    hidden: Mapping[Path | None, str] | None = None,
    command: str | None = None,
    processes: int = 1,
) -> list[str]:
    """List what a run was: its command, date, machine, versions and seeds."""
    found = made(command or command_line(hidden), processes)
    if seeds:
        of_a_row = len(seeds) > ROW and list(seeds) == list(range(seeds[0], seeds[0] + len(seeds)))
        found["seeds"] = f"{seeds[0]} to {seeds[-1]}" if of_a_row else ", ".join(map(str, seeds))
    return [f"- {name}: {value}" for name, value in found.items()]


def write_section(
    file: Path | None,
    page: Page,
    title: str,
    figures: dict[str, Any],
    *,
    seeds: Sequence[int] | None = None,
    hidden: Mapping[Path | None, str] | None = None,
) -> None:
    """Write the section ``title`` of a page, in the place of an older one; nothing where no file is asked for."""
    if file is None:
        return
    if page.timed:
        figures = figures | {"load_of_the_machine": round(os.getloadavg()[1], 1)}
    lines = [f"## {title}", "", *facts(seeds=seeds, hidden=hidden)]
    lines += ["", "| | |", "| --- | --- |", *(f"| {name} | {_shown(value)} |" for name, value in figures.items()), ""]
    text = file.read_text(encoding="utf-8") if file.exists() else page.head
    beginning, *sections = re.split(r"(?m)^(?=## )", text)
    kept = [section for section in sections if not section.startswith(f"## {title}\n")]
    place = next((i for i, section in enumerate(sections) if section.startswith(f"## {title}\n")), len(kept))
    kept.insert(place, "\n".join(lines))
    write_page(file, "\n\n".join(part.strip() for part in (beginning, *kept)))


def put_page(file: Path | None, lines: Sequence[str]) -> None:
    """Write a whole page, or print it where no file is asked for."""
    text = "\n".join(lines).rstrip() + "\n"
    if file is None:
        print(text)
    else:
        write_page(file, text)


def write_page(file: Path, text: str) -> None:
    """Write a whole page."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text.rstrip() + "\n", encoding="utf-8")


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name}: {_shown(item)}" for name, item in value.items()) or "none"
    if isinstance(value, list):
        return "; ".join(map(_shown, value)) or "none"
    return str(value).replace("|", "/").replace("\n", " ")
