"""Pictures of the PCAO report."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from app.evaluation.pcao.experiments import HISTORY_EVERY
from app.evaluation.pcao.report import Findings

DPI = 110


def draw_time(path: Path, found: Findings) -> bool:
    """Draw what remains over the steps, one panel per map; return whether there was anything to draw."""
    titles = [t for t, name in found.names.items() if any(run["terrain"] == name for run in found.flights)]
    if not titles:
        return False
    figure = Figure(figsize=(3.6 * len(titles), 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(titles), sharey=True, squeeze=False)[0]
    for axes, title in zip(panels, titles, strict=True):
        runs = [run for run in found.flights if run["terrain"] == found.names[title]]
        for number, name in enumerate(dict.fromkeys(run["algorithm"] for run in runs)):
            mean = np.mean([run["history"] for run in runs if run["algorithm"] == name], axis=0)
            axes.plot(HISTORY_EVERY * np.arange(1, len(mean) + 1), mean, color=f"C{number}", label=name)
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("step")
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("remaining landmarks, %")
    panels[0].set_ylim(0.0, 100.0)
    panels[-1].legend(fontsize=8)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    return True


def draw_learning(path: Path, found: Findings) -> bool:
    """Draw figure 2: scores of the controllers tried (dots) and the best so far (lines)."""
    if not found.curves:
        return False
    figure = Figure(figsize=(8.0, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    best = min(min(run["scores"]) for run in found.curves)
    for number, method in enumerate(dict.fromkeys(run["method"] for run in found.curves)):
        for k, run in enumerate(r for r in found.curves if r["method"] == method):
            at = np.arange(1, len(run["scores"]) + 1)
            axes.plot(at, run["scores"], ".", color=f"C{number}", markersize=2, alpha=0.3)
            label = method if k == 0 else None
            axes.plot(at, np.minimum.accumulate(run["scores"]), color=f"C{number}", label=label)
    axes.set_ylim(0.8 * best, 8.0 * best)
    axes.set_yscale("log")
    axes.set_xlabel("controllers tried")
    axes.set_ylabel("E(P) of eq. (17), per run")
    axes.legend()
    axes.grid(alpha=0.3, which="both")
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    return True
