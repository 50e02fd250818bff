"""A trained controller as it is written to a file: plain JSON with P, what it was trained for, and by which command."""

from functools import cache
from importlib.resources import files
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from app.arrays import FloatArray
from app.exploration.pcao.controller import BLOCKS, E1, E2, L, blocks, entries, gains
from app.exploration.pcao.state import FIGURES, N_FIGURES, N_VECTORS, VECTORS

Number = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Matrix = Annotated[tuple[tuple[Number, ...], ...], Field(max_length=64)]

TOLERANCE = 1e-6
DEFAULT_FILE = "default.json"


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Block(_Part):
    """The blocks of P of one mixing signal; both symmetric, with eigenvalues between e1 and e2."""

    horizontal: Matrix = Field(description=f"{N_VECTORS} x {N_VECTORS}, in the order of state.vectors")
    vertical: Matrix = Field(description=f"{N_FIGURES} x {N_FIGURES}, in the order of state.figures")


class StateDefinition(_Part):
    """What P multiplies; docs/pcao.md says how each is made."""

    vectors: tuple[str, ...] = VECTORS
    figures: tuple[str, ...] = FIGURES
    mixing_signals: int = L

    @model_validator(mode="after")
    def _is_ours(self) -> Self:
        if (self.vectors, self.figures, self.mixing_signals) != (VECTORS, FIGURES, L):
            raise ValueError(
                f"the model was trained for another state than this version makes, which has the vectors "
                f"{', '.join(VECTORS)}, the figures {', '.join(FIGURES)} and {L} mixing signals: train it anew"
            )
        return self


class Training(_Part):
    """How the controller came about."""

    command: str = Field(default="", max_length=200_000, description="What makes it again")
    bathyfleet: str = Field(default="", max_length=40, description="The version that trained it")
    method: str = Field(default="", max_length=40, description="pcao, cma or random")
    seed: int = Field(default=0, ge=0, description="Of the optimiser")
    terrains: tuple[str, ...] = Field(default=(), max_length=10_000)
    seeds: tuple[int, ...] = Field(default=(), max_length=10_000, description="Of the Monte-Carlo runs on each terrain")
    robots: int = Field(default=3, ge=1)
    landmarks: int = Field(default=1100, ge=1)
    steps: int = Field(default=500, ge=1)
    evaluations: int = Field(default=0, ge=0, description="Controllers that were scored")
    score: float | None = Field(default=None, description="E(P) of eq. (17), per run")


class PcaoModel(_Part):
    """A controller that ``bathyfleet train`` wrote."""

    format: Literal["bathyfleet-pcao"] = "bathyfleet-pcao"
    version: Literal[1] = 1
    state: StateDefinition = StateDefinition()
    e1: float = Field(default=E1, gt=0, allow_inf_nan=False)
    e2: float = Field(default=E2, gt=0, allow_inf_nan=False)
    P: tuple[Block, ...] = Field(min_length=L, max_length=L, description="One block per mixing signal")
    training: Training = Training()

    @field_validator("P")
    @classmethod
    def _has_the_right_shape(cls, P: tuple[Block, ...]) -> tuple[Block, ...]:
        for number, block in enumerate(P):
            for name, matrix, size in (
                ("horizontal", block.horizontal, N_VECTORS), ("vertical", block.vertical, N_FIGURES),
            ):  # fmt: skip
                if [len(row) for row in matrix] != [size] * size:
                    raise ValueError(f"P[{number}].{name} must have {size} rows of {size} numbers")
                if not np.allclose(matrix, np.transpose(matrix), atol=TOLERANCE):
                    raise ValueError(f"P[{number}].{name} is not symmetric")
        return P

    @model_validator(mode="after")
    def _keeps_its_bounds(self) -> Self:
        for number, block in enumerate(blocks(self.parameters)):
            values = np.linalg.eigvalsh(block)
            if values[0] < self.e1 - TOLERANCE or values[-1] > self.e2 + TOLERANCE:
                name = "vertical" if number % 2 else "horizontal"
                raise ValueError(
                    f"P[{number // 2}].{name} has eigenvalues from {values[0]:.3g} to {values[-1]:.3g}; "
                    f"they must lie between e1 = {self.e1:g} and e2 = {self.e2:g}"
                )
        return self

    @classmethod
    def of(cls, parameters: FloatArray, training: Training) -> "PcaoModel":
        """Return the model of a controller's free entries (SIZE,)."""
        parts = [tuple(tuple(float(x) for x in row) for row in block) for block in blocks(parameters)]
        pairs = zip(parts[0::2], parts[1::2], strict=True)
        return cls(P=tuple(Block(horizontal=h, vertical=v) for h, v in pairs), training=training)

    @property
    def parameters(self) -> FloatArray:
        """The free entries of P, (SIZE,)."""
        matrices = [np.array(part) for block in self.P for part in (block.horizontal, block.vertical)]
        return entries([matrix.reshape(size, size) for matrix, size in zip(matrices, BLOCKS, strict=True)])

    @property
    def gains(self) -> tuple[FloatArray, FloatArray]:
        """B'P_l, see :func:`app.exploration.pcao.controller.gains`."""
        return gains(self.parameters)


@cache
def default_model() -> PcaoModel:
    """Return the controller that ships with the package."""
    return PcaoModel.model_validate_json(files("app.exploration.pcao").joinpath(DEFAULT_FILE).read_bytes())
