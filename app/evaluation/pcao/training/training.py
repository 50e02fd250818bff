"""Training: an optimiser looks for the best P while every generation's scores are written down as they come.

What an optimiser proposes follows from its seed and the scores so far, so the scores are the checkpoint: killed at any
moment, training goes on where it was, and ends with the same controller as if it had never stopped.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from app.arrays import FloatArray
from app.evaluation.pcao.training.optimisers import METHODS, Optimiser
from app.evaluation.pcao.training.scoring import Scorer
from app.exploration.pcao.model import PcaoModel, Training


class CheckpointError(Exception):
    """A checkpoint that cannot be gone on from; ``str()`` says why and what to do."""


@dataclass
class Curve:
    """The learning curve: what every evaluation scored, and the best so far."""

    scores: list[float] = field(default_factory=list)

    @property
    def best(self) -> list[float]:
        """The best so far, after every evaluation."""
        return np.minimum.accumulate(self.scores).tolist() if self.scores else []


class Checkpoint:
    """A file of lines: what is trained, then every generation's controllers (a checksum of them) and scores.

    A line is written at once and synced; a last one that was cut off when the process was killed is dropped.
    """

    def __init__(self, path: Path, settings: dict[str, Any]) -> None:
        """Open or begin. Raises CheckpointError when the file is of another training."""
        self._path = path
        self.generations: list[dict[str, Any]] = []
        lines = _whole_lines(path)
        if lines:
            differing = [name for name in settings if lines[0].get(name) != settings[name]]
            if differing:
                said = "; ".join(
                    f"{name} is {lines[0].get(name)!r} there, {settings[name]!r} here" for name in differing
                )
                raise CheckpointError(
                    f"{path} is of another training ({said}): take the same settings, another --out, or remove it"
                )
            self.generations = lines[1:]
        else:
            write_atomically(path, orjson.dumps(settings) + b"\n")

    def add(self, generation: dict[str, Any]) -> None:
        """Write a generation down."""
        with self._path.open("ab") as out:
            out.write(orjson.dumps(generation) + b"\n")
            out.flush()
            os.fsync(out.fileno())


def train(
    optimiser: Optimiser,
    scorer: Scorer,
    checkpoint: Checkpoint,
    evaluations: int,
    progress: Callable[[Curve], None] = lambda curve: None,
    better: Callable[[Optimiser, Curve], None] = lambda optimiser, curve: None,
) -> Curve:
    """Train until all controllers were scored, those of the checkpoint included; return the learning curve.

    ``progress`` is called after every generation, ``better`` whenever there is a new best controller.
    """
    curve, known = Curve(), list(checkpoint.generations)
    for number, generation in enumerate(known):
        asked = optimiser.ask()
        if generation["asked"] != _digest(asked):
            raise CheckpointError(
                f"the checkpoint's generation {number + 1} cannot be repeated: it was made with another version of "
                "bathyfleet, numpy or cma; begin anew with another --out"
            )
        optimiser.tell(asked, generation["scores"])
        curve.scores += generation["scores"]
    progress(curve)
    while len(curve.scores) < evaluations:
        before = optimiser.best_score
        asked = optimiser.ask()
        scores = scorer.score(asked)
        checkpoint.add({"asked": _digest(asked), "scores": scores})
        optimiser.tell(asked, scores)
        curve.scores += scores
        progress(curve)
        if optimiser.best_score < before:
            better(optimiser, curve)
    return curve


def make_optimiser(method: str, seed: int) -> Optimiser:
    """Return one of ``METHODS``."""
    return METHODS[method](seed)


def write_model(path: Path, optimiser: Optimiser, training: Training) -> PcaoModel:
    """Write the best controller so far to a model file, all or nothing."""
    model = PcaoModel.of(optimiser.best, training)
    write_atomically(path, orjson.dumps(model.model_dump(mode="json"), option=orjson.OPT_INDENT_2) + b"\n")
    return model


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file so that at no moment there is half of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    with part.open("wb") as out:
        out.write(content)
        out.flush()
        os.fsync(out.fileno())
    part.replace(path)


def _digest(controllers: list[FloatArray]) -> str:
    """Return what distinguishes generations; rounded, as other processors round the last digit otherwise."""
    return " ".join(f"{float(np.abs(p).sum()):.6g}" for p in controllers)


def _whole_lines(path: Path) -> list[dict[str, Any]]:
    if not path.is_file():
        return []
    content = path.read_bytes()
    end = content.rfind(b"\n") + 1
    lines = [orjson.loads(line) for line in content[:end].splitlines()]
    if end < len(content):
        write_atomically(path, content[:end])
    return lines
