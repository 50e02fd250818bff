"""The report in Markdown: one table per section, means with 95 % intervals, published figures beside ours."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.evaluation.explore.run import OSARSES
from app.evaluation.explore.setups import ReportSection, Setup, run_key
from app.evaluation.runs.summary import mean_text, spread

Runs = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Report:
    """What the report is made of.

    Attributes
    ----------
    runs : mapping
        Results by key; missing ones are left out and counted.
    sections : sequence of Section
        In order.
    terrains : sequence of str
        Names, in order; those with a missing file are in ``missing``.
    seeds, steps
        Of every run.
    facts : mapping
        What stands in the head: command, date, machine, versions.
    pictures : mapping
        Section name -> file name of its picture, relative to the report.
    """

    runs: Runs
    sections: Sequence[ReportSection]
    terrains: Sequence[str]
    missing: Sequence[str]
    seeds: Sequence[int]
    steps: int
    facts: Mapping[str, str]
    pictures: Mapping[str, str]

    def of(self, setup: Setup, terrain: str) -> list[Mapping[str, Any]]:
        """Return the runs of a setup on a terrain, by seed."""
        keys = (run_key(setup, terrain, seed, self.steps) for seed in self.seeds)
        return [self.runs[key] for key in keys if key in self.runs]

    def terrains_of(self, section: ReportSection) -> Sequence[str]:
        """Return the names of the terrains that a section uses."""
        return self.terrains[: section.terrains]


def markdown(report: Report) -> str:
    """Return the whole report."""
    lines = ["# Exploration: the papers' scenario over many seeds", ""]
    lines += [f"- {name}: {value}" for name, value in report.facts.items()]
    wanted = [(setup, terrain) for s in report.sections for _, setup in s.rows for terrain in report.terrains_of(s)]
    lacking = sum(len(report.seeds) - len(report.of(*pair)) for pair in dict.fromkeys(wanted))
    lines += [
        f"- terrains: {', '.join(report.terrains)}",
        *([f"- left out, because their files were not found: {', '.join(report.missing)}"] if report.missing else []),
        *([f"- **incomplete**: {lacking} runs are still missing"] if lacking else []),
        "",
        f"Figures are means over {len(report.seeds)} seeds unless a table says otherwise, ± half their 95 % interval "
        f"(Student). {report.steps} steps per run. *broken*: steps of single vehicles per run on which a limit was "
        "broken that was kept before. Where not every run reached 1 % remaining, t99 is the mean of those that did, "
        "with their number. The papers' maps were never published: theirs and ours are different sea floors.",
        "",
    ]
    for section in report.sections:
        lines += _section(report, section)
    return "\n".join(lines)


def _section(report: Report, section: ReportSection) -> list[str]:
    terrains = report.terrains_of(section)
    lines = [f"## {section.title}", "", section.text + _seeds_of(report, section), ""]
    if section.name in report.pictures:
        lines += [f"![{section.title}]({report.pictures[section.name]})", ""]
    timed = not any(setup.planner == OSARSES for _, setup in section.rows)
    tables = (("Remaining landmarks, %", _remaining), *((("t99, steps", _t99), ("broken", _broken)) if timed else ()))
    for what, cell in tables:
        published = bool(section.published) and cell is _remaining
        lines.append(f"| {what} | " + " | ".join(terrains) + (" | published |" if published else " |"))
        lines.append("|" + " --- |" * (1 + len(terrains) + published))
        for label, setup in section.rows:
            cells = [cell(report.of(setup, terrain)) for terrain in terrains]
            if published:
                cells.append(section.published.get(label, ""))
            lines.append(f"| {label} | " + " | ".join(cells) + " |")
        lines.append("")
    return lines + _improvements(report, section)


def _improvements(report: Report, section: ReportSection) -> list[str]:
    """Return AURO15's percentages: by how much CAO leaves less than OSARSES(C), of what OSARSES(C) leaves."""
    tried = [(label, setup) for label, setup in section.rows if setup.planner == OSARSES]
    free = [(label, setup) for label, setup in section.rows if setup.planner != OSARSES]
    if not tried or not free:
        return []
    terrains = report.terrains_of(section)
    lines = [
        "Improvement in %, of what OSARSES(C) leaves (AURO15: 79.7 and 24.1 % on Map #1 over C = 0 and 5; on Map #2 "
        "147.3 and 9 %, of which the first is relative to what CAO leaves):",
        "",
        "| better by % | " + " | ".join(terrains) + " |",
        "|" + " --- |" * (1 + len(terrains)),
    ]
    for ours, setup in free:
        for theirs, other in tried:
            if setup.landmarks != other.landmarks:
                continue
            cells = [_improvement(report.of(setup, terrain), report.of(other, terrain)) for terrain in terrains]
            name = theirs.removesuffix(ours[ours.rindex(",") :])
            lines.append(f"| {ours} over {name} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def _improvement(ours: Sequence[Mapping[str, Any]], theirs: Sequence[Mapping[str, Any]]) -> str:
    if not ours or not theirs:
        return "–"
    left, other = (spread([float(run["remaining_pct"]) for run in runs]).mean for runs in (ours, theirs))
    return f"{100.0 * (other - left) / other:.1f}" if other > 0.0 else "–"


def _remaining(runs: Sequence[Mapping[str, Any]]) -> str:
    return mean_text([float(run["remaining_pct"]) for run in runs], 2)


def _broken(runs: Sequence[Mapping[str, Any]]) -> str:
    return mean_text([float(run["broken_constraints"]) for run in runs], 1)


def _t99(runs: Sequence[Mapping[str, Any]]) -> str:
    reached = [float(run["t99"]) for run in runs if run["t99"] is not None]
    if not reached:
        return "never" if runs else "–"
    number = "" if len(reached) == len(runs) else f" ({len(reached)} of {len(runs)})"
    return mean_text(reached, 0) + number


def _seeds_of(report: Report, section: ReportSection) -> str:
    """Say how many seeds stand behind a table where that is not the same everywhere."""
    numbers = {len(report.of(setup, t)) for _, setup in section.rows for t in report.terrains_of(section)}
    low, high = min(numbers), max(numbers)
    if low == high == len(report.seeds):
        return ""
    return f" Means over {low} seeds." if low == high else f" Means over {low} to {high} seeds."
