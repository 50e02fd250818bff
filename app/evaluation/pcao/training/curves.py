"""Learning curves as pictures (the paper's figure 2)."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np


def draw_curve(path: Path, scores: Mapping[str, Sequence[float]], ceiling: float | None = None) -> None:
    """Draw what every evaluation scored (dots) and the best so far (lines), by method.

    ``ceiling`` bounds the axis: a random controller may score many times as much as a good one.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for number, (name, values) in enumerate(scores.items()):
        at = np.arange(1, len(values) + 1)
        axes.plot(at, values, ".", color=f"C{number}", markersize=2, alpha=0.35)
        axes.plot(at, np.minimum.accumulate(values), color=f"C{number}", label=name)
    if ceiling is not None:
        axes.set_ylim(0.0, ceiling)
    axes.set_xlabel("controllers tried")
    axes.set_ylabel("E(P), per run")
    axes.legend()
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110, metadata={"Software": None})
