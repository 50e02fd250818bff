"""Pictures of the report."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from app.evaluation.explore.report import Report
from app.evaluation.explore.run import OSARSES
from app.evaluation.explore.setups import HISTORY_EVERY, ReportSection
from app.evaluation.runs.summary import spread

DPI = 110
PANEL = (4.6, 3.4)
COLUMNS = 3
DONE_PCT = 1.0


def draw(report: Report, folder: Path) -> dict[str, str]:
    """Write one picture per section that has runs into ``folder``; return section name -> file name."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {}
    for section in report.sections:
        terrains = [t for t in report.terrains_of(section) if any(report.of(s, t) for _, s in section.rows)]
        if not terrains:
            continue
        tried = any(setup.planner == OSARSES for _, setup in section.rows)
        figure = _bars(report, section, terrains) if tried else _curves(report, section, terrains)
        file = folder / f"{section.name}.png"
        figure.savefig(file, dpi=DPI, metadata={"Software": None})
        pictures[section.name] = file.name
    return pictures


def _bars(report: Report, section: ReportSection, terrains: Sequence[str]) -> Figure:
    """Remaining landmarks of every row, with 95 % intervals."""
    figure = _figure(2 * PANEL[0], 0.7 + 0.16 * len(section.rows) * len(terrains) + 0.14 * len(section.rows))
    axes = figure.subplots()
    height = 0.8 / len(terrains)
    rows = np.arange(len(section.rows))
    for k, terrain in enumerate(terrains):
        spreads = [_remaining(report.of(setup, terrain)) for _, setup in section.rows]
        axes.barh(
            rows + (k - (len(terrains) - 1) / 2) * height,
            [s[0] for s in spreads],
            height,
            xerr=[s[1] for s in spreads],
            label=terrain,
            error_kw={"elinewidth": 0.8, "capsize": 2},
        )
    axes.set_yticks(rows, [label for label, _ in section.rows])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 100.0)
    axes.set_xlabel(f"landmarks remaining after {report.steps} steps, %")
    axes.grid(axis="x", alpha=0.3)
    figure.legend(loc="outside upper center", ncols=len(terrains), frameon=False)
    return figure


def _curves(report: Report, section: ReportSection, terrains: Sequence[str]) -> Figure:
    """Remaining landmarks over the steps, a panel per terrain, with 95 % intervals."""
    across = min(COLUMNS, len(terrains))
    down = math.ceil(len(terrains) / across)
    figure = _figure(across * PANEL[0], down * PANEL[1] + 0.3)
    panels = np.atleast_1d(figure.subplots(down, across, sharex=True, sharey=True, squeeze=False).ravel())
    for panel, terrain in zip(panels, terrains, strict=False):
        for number, (label, setup) in enumerate(section.rows):
            runs = report.of(setup, terrain)
            if not runs:
                continue
            history = np.array([run["history"] for run in runs])
            steps = HISTORY_EVERY * (1 + np.arange(history.shape[1]))
            spreads = [spread(column) for column in history.T]
            mean, half = (np.array([getattr(s, name) for s in spreads]) for name in ("mean", "ci95"))
            panel.plot(steps, mean, color=f"C{number}", label=label, linewidth=1.4)
            panel.fill_between(steps, mean - half, mean + half, color=f"C{number}", alpha=0.2, linewidth=0)
        panel.axhline(DONE_PCT, color="0.5", linewidth=0.8, linestyle=":")
        panel.set_yscale("symlog", linthresh=1.0)
        panel.set_ylim(0.0, 100.0)
        panel.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
        panel.set_title(terrain, fontsize="medium")
        panel.grid(alpha=0.3)
    for panel in panels[len(terrains) :]:
        panel.set_visible(False)
    figure.supxlabel("step", fontsize="medium")
    figure.supylabel("landmarks remaining, %", fontsize="medium")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=max(1, len(labels)), frameon=False)
    return figure


def _remaining(runs: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    if not runs:
        return 0.0, 0.0
    s = spread([float(run["remaining_pct"]) for run in runs])
    return s.mean, s.ci95


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure
