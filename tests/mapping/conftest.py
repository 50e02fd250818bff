"""Real sea floors, where they are at hand."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.arrays import FloatArray

PROJECT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def real_terrain() -> Callable[[str], FloatArray]:
    """Load a real terrain by name: depths of 1 m cells, row 0 south."""
    folder = Path(os.environ.get("BATHYFLEET_TERRAINS", PROJECT.parent / "shared" / "terrains"))

    def load(name: str) -> FloatArray:
        path = folder / f"{name}.npz"
        if not path.exists():
            pytest.skip(f"{path} is not there; set BATHYFLEET_TERRAINS to the folder of the real terrains")
        with np.load(path) as file:
            assert float(file["cell_m"]) == 1.0
            return np.asarray(file["z"], float)

    return load
