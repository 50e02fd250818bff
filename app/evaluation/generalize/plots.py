"""Pictures of the worst floors of a task: the sea floor, where the vehicles went, what was left."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from app.evaluation.generalize.summary import Run, figure_of, worst_of
from app.evaluation.generalize.tasks import TableTask
from simulator.floors.unseen_floors import unseen_floor

DPI = 60
PANEL = 3.0


def draw_worst(name: str, task: TableTask, runs: Sequence[Run], file: Path) -> None:
    """Write the picture of a task's worst floors."""
    chosen = worst_of(task, runs)
    figure = Figure(figsize=(PANEL * len(chosen), PANEL + 0.5), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, run in zip(np.atleast_1d(figure.subplots(1, len(chosen))), chosen, strict=True):
        width_m, height_m = task.size_m
        floor = unseen_floor(run["family"], run["seed"], width_m=width_m, height_m=height_m)
        shape = (0.0, 1.0, 0.0, 1.0)
        axes.imshow(floor.z_m, origin="lower", extent=shape, cmap="Blues", aspect=height_m / width_m, alpha=0.8)
        for number, track in enumerate(run["tracks"]):
            axes.plot(*np.array(track).T, color=f"C{number + 1}", linewidth=0.8)
        if run["missed"]:
            axes.plot(*np.array(run["missed"]).T, linestyle="", marker=".", color="black", markersize=3.0)
        axes.set_title(f"{run['floor']}\n{name} {figure_of(task, run):.3g}", fontsize=9)
        axes.set_xticks([])
        axes.set_yticks([])
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=DPI, metadata={"Software": None})
