"""The PCAO report in Markdown: the paper's tables and figures beside ours."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from app.evaluation.pcao.experiments import MAPS, TEAMS, CurveJob, PaperMap
from app.evaluation.pcao.published import BEST, MEANS, TABLE2, TABLES
from app.evaluation.pcao.simulation.world import LANDMARKS, STEPS
from app.evaluation.runs.summary import spread
from app.exploration.pcao.model import PcaoModel

Run = Mapping[str, Any]


@dataclass
class Findings:
    """The runs that there are, sorted by what they are for."""

    flights: list[Run] = field(default_factory=list)
    table2: list[Run] = field(default_factory=list)
    curves: list[Run] = field(default_factory=list)
    teams: list[Run] = field(default_factory=list)
    others: list[Run] = field(default_factory=list)
    lacking: int = 0
    names: Mapping[str, str] = field(default_factory=dict)
    """Terrain that stands for each of the paper's maps, by the map's title; those that are at hand."""
    landmarks: int = LANDMARKS
    steps: int = STEPS
    seeds: Sequence[int] = ()
    """Of the flights."""


def markdown(found: Findings, model: PcaoModel, facts: Mapping[str, str], speed: Sequence[str], pictures: bool) -> str:
    """Return the whole report; what has not been run is left out and counted."""
    lines = ["# PCAO: a controller trained once", ""]
    lines += [f"- {name}: {value}" for name, value in facts.items()]
    lines += [f"- model: {model.training.method}, {model.training.evaluations} controllers tried on "
              f"{', '.join(model.training.terrains)}; `{model.training.command}`"]  # fmt: skip
    lines += [f"- **incomplete**: {found.lacking} runs are still missing"] if found.lacking else []
    lines += [
        "", f"PCAO18's experiment: 3 vehicles with multibeam sonars, {found.landmarks} landmarks, {found.steps} steps; "
        f"remaining landmarks in %, means ± half their 95 % interval (Student), and how many runs. "
        f"{_trained_with(found, model)} The paper's sea floors were never published, and its table I lost its numbers: "
        "what stands for them, and how the sonar was chosen, says [PCAO](../pcao.md). `pcao` is the model above, "
        "with visits where it gets nowhere; the controllers of table II fly without. Mapping "
        "time is what the team really swims, tries included.", "",
    ]  # fmt: skip
    lines += ["| the paper's | here | in the model's training |", "| --- | --- | --- |"]
    for paper in MAPS:
        stands = found.names.get(paper.title, f"{paper.stands} (not at hand)")
        trained = any(stands == name for name in model.training.terrains)
        lines.append(f"| {paper.title} | {stands} | {'yes' if trained else 'no'} |")
    lines += ["", *_table2(found), *_table3(found)]
    for paper in MAPS:
        lines += [] if paper.training else _table_unseen(found, paper)
    if pictures:
        lines += ["## Over time (figures 3, 5, 6, 7)", "", "![Remaining over time](images/pcao-time.png)", ""]
        lines += ["## Learning (figure 2)", "", "![Learning](images/pcao-learning.png)", "", *_learning(found)]
    lines += [*_others(found), *_teams(found), "## Speed", "", *speed]
    return "\n".join(lines)


def _trained_with(found: Findings, model: PcaoModel) -> str:
    """Return whether flights were in a training: of the model, or of figure 2."""
    both = sorted({*found.seeds} & {*model.training.seeds, *CurveJob.seeds})
    if not both:
        return "Starts, landmarks and noise of these runs were in no training."
    return f"Starts, landmarks and noise of the seeds {', '.join(map(str, both))} were in a training."


def _table2(found: Findings) -> list[str]:
    lines = ["## Table II: what training brings", "", "The controllers of the first searches of figure 2.", ""]
    lines += ["| | map | here | published | steps to 99 % |", "| --- | --- | --- | --- | --- |"]
    for (row, title), value in TABLE2.items():
        runs = _of(found.table2, found.names.get(title), row)
        lines.append(f"| {row} | {title} | {_mean(runs)} | {value:g} | {_t99(runs)} |")
    for title in ("Real Map 1", "Artificial Map 1"):
        runs = _of(found.table2, found.names.get(title), "best of CMA-ES")
        lines.append(f"| best of CMA-ES | {title} | {_mean(runs)} | – | {_t99(runs)} |")
    return [*lines, ""]


def _table3(found: Findings) -> list[str]:
    maps = [paper for paper in MAPS if paper.training]
    lines = ["## Table III: on the maps of the training", ""]
    lines.append(
        "| algorithm | mapping time | " + " | ".join(f"{p.title} | published | steps to 99 %" for p in maps) + " |"
    )
    lines.append("|" + " --- |" * (2 + 3 * len(maps)))
    for name in ("pcao", "SE(0)", "SE(5)", "SE(50)", "SE(500)", "SPSA", "FDSA"):
        cells, cost = [], "–"
        for paper in maps:
            runs = _of(found.flights, found.names.get(paper.title), name)
            cost = str(runs[0]["mapping_time"]) if runs else cost
            published = MEANS[paper.title].get(name)
            cells += [_mean(runs), "–" if published is None else f"{published:g}", _t99(runs)]
        lines.append(f"| {name} | {cost} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def _table_unseen(found: Findings, paper: PaperMap) -> list[str]:
    lines = [f"## Table {TABLES[paper.title]}: {paper.title}", ""]
    lines += ["| algorithm | mapping time | mean | published | best | published | steps to 99 % |", "|" + " --- |" * 7]
    for name in ("pcao", "SE(0)", "SE(5)", "SE(50)", "SPSA", "FDSA"):
        runs = _of(found.flights, found.names.get(paper.title), name)
        mean, best = MEANS[paper.title].get(name), BEST[paper.title].get(name)
        least = f"{min(run['remaining_pct'] for run in runs):.2f}" if runs else "–"
        printed = "–" if best is None else f"{best:g}"
        lines.append(
            f"| {name} | {runs[0]['mapping_time'] if runs else '–'} | {_mean(runs)} | "
            f"{'–' if mean is None else f'{mean:g}'} | {least} | {printed} | {_t99(runs)} |"
        )
    return [*lines, ""]


def _learning(found: Findings) -> list[str]:
    if not found.curves:
        return []
    lines = ["Best E(P) per run after so many controllers; several searches, mean and range:", ""]
    length = min(len(run["scores"]) for run in found.curves)
    at = sorted({max(1, round(part * length)) for part in (0.03, 0.1, 0.3, 0.6, 1.0)})
    lines += ["| method | searches | " + " | ".join(map(str, at)) + " |", "|" + " --- |" * (2 + len(at))]
    for method in dict.fromkeys(run["method"] for run in found.curves):
        best = np.array([np.minimum.accumulate(r["scores"])[:length] for r in found.curves if r["method"] == method])
        cells = [f"{best[:, k - 1].mean():.2f} ({best[:, k - 1].min():.2f} to {best[:, k - 1].max():.2f})" for k in at]
        lines.append(f"| {method} | {len(best)} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def _others(found: Findings) -> list[str]:
    if not found.others:
        return []
    lines = ["## Further sea floors that no training saw", "", "| sea floor | pcao | steps to 99 % | SE(5) |"]
    lines.append("| --- | --- | --- | --- |")
    for terrain in dict.fromkeys(run["terrain"] for run in found.others):
        runs = _of(found.others, terrain, "pcao")
        lines.append(f"| {terrain} | {_mean(runs)} | {_t99(runs)} | {_mean(_of(found.others, terrain, 'SE(5)'))} |")
    return [*lines, ""]


def _teams(found: Findings) -> list[str]:
    if not found.teams:
        return []
    lines = [
        "## Other teams", "", "The same model, trained with 3 vehicles, in AURO15's scenario (vehicles see all round, "
        "no limit to communication), where the literal CAO (polynomial regressors, the team's objective) flies too. "
        "Steps to 99 % are means of the runs that came there.", "",
        "| vehicles | sea floor | pcao | steps to 99 % | literal CAO | SE(0) |", "|" + " --- |" * 6,
    ]  # fmt: skip
    for robots in TEAMS:
        for terrain in dict.fromkeys(run["terrain"] for run in found.teams):
            mine = [run for run in found.teams if run["robots"] == robots]
            runs = _of(mine, terrain, "pcao")
            cells = [_mean(_of(mine, terrain, name)) for name in ("literal CAO", "SE(0)")]
            lines.append(f"| {robots} | {terrain} | {_mean(runs)} | {_t99(runs)} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def _of(runs: Sequence[Run], terrain: str | None, algorithm: str) -> list[Run]:
    return [run for run in runs if run["terrain"] == terrain and run["algorithm"] == algorithm]


def _mean(runs: Sequence[Run]) -> str:
    if not runs:
        return "–"
    s = spread([run["remaining_pct"] for run in runs])
    return f"{s.mean:.2f} ± {s.ci95:.2f} ({len(runs)})"


def _t99(runs: Sequence[Run]) -> str:
    """Return the mean number of steps to 99 %, of the runs that came there, and how many these are."""
    done = [run["t99"] for run in runs if run["t99"] is not None]
    return f"{np.mean(done):.0f} ({len(done)} of {len(runs)})" if done else "–"
