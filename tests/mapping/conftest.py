"""Real sea floors, where they are at hand."""

from collections.abc import Callable

import numpy as np
import pytest

from app.arrays import FloatArray
from tests.support.paths import TERRAINS


@pytest.fixture(scope="session")
def real_terrain() -> Callable[[str], FloatArray]:
    """Load a real terrain by name: depths of 1 m cells, row 0 south."""

    def load(name: str) -> FloatArray:
        path = TERRAINS / f"{name}.npz"
        if not path.exists():
            pytest.skip(f"{path} is not there; set BATHYFLEET_TERRAINS to the folder of the real terrains")
        with np.load(path) as file:
            assert float(file["cell_m"]) == 1.0
            return np.asarray(file["z"], float)

    return load
