"""Grids that nobody could hold in memory are refused in words."""

from typing import Any

import pytest
from pydantic import ValidationError

from app.missions.spec.site import SiteSpec
from tests.support.missions.specs import make_spec, rectangle


@pytest.mark.parametrize("cell_m", [1e-3, 1e-300, 5e-324])
def test_cells_that_are_too_small_are_told_how_many_they_are(cell_m: float) -> None:
    area: Any = rectangle(0, 0, 100, 100)
    with pytest.raises(ValidationError, match="make cell_m larger"):
        SiteSpec.model_validate({"name": "harbour", "area": area, "cell_m": cell_m})
    with pytest.raises(ValidationError, match="cell_m"):
        make_spec(cell_m=cell_m)
