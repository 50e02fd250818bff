"""Pictures of the tracking report: what remains and the error's norm over time, with 95 % intervals."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from app.evaluation.runs.summary import spread
from app.evaluation.track.setups import HISTORY_EVERY, Experiment, TrackReportJob

DPI = 110
SIZE = (9.2, 3.4)
PANELS = (("history", "landmarks remaining, %"), ("error", "norm of the landmarks' error"))


def draw(
    jobs: Sequence[TrackReportJob], runs: Mapping[str, Mapping[str, Any]], chosen: Sequence[Experiment], folder: Path
) -> dict[str, str]:
    """Write one picture per experiment that has runs into ``folder``; return its name -> file name."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {}
    for experiment in chosen:
        figure = Figure(figsize=SIZE, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, len(PANELS))
        drawn = False
        for number, planner in enumerate(experiment.planners):
            keys = [job.key for job in jobs if job.setup == experiment.name and job.planner == planner]
            there = [runs[key] for key in keys if key in runs]
            for panel, (name, _) in zip(panels, PANELS, strict=True):
                if not there:
                    continue
                values = np.array([run[name] for run in there])
                steps = HISTORY_EVERY * (1 + np.arange(values.shape[1]))
                spreads = [spread(column) for column in values.T]
                mean, half = (np.array([getattr(s, part) for s in spreads]) for part in ("mean", "ci95"))
                panel.plot(steps, mean, color=f"C{number}", label=planner, linewidth=1.4)
                panel.fill_between(steps, mean - half, mean + half, color=f"C{number}", alpha=0.2, linewidth=0)
                drawn = True
        for panel, (_, label) in zip(panels, PANELS, strict=True):
            panel.set_ylabel(label)
            panel.set_xlabel("step")
            panel.set_ylim(bottom=0.0)
            panel.grid(alpha=0.3)
        if not drawn:
            continue
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
        file = folder / f"tracking-{experiment.name}.png"
        figure.savefig(file, dpi=DPI, metadata={"Software": None})
        pictures[experiment.name] = file.name
    return pictures
