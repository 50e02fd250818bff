"""Who sweeps what: shares are whole lines over the bottom as it likely is."""

import numpy as np
import pytest

from app.estimation.swath import SwathSonar
from app.exploration.core.coverage import Coverage
from app.exploration.swath.assignment import Assignment
from app.exploration.swath.raster import Flying, Rasters
from app.exploration.swath.shares import share_out

FLYING = Flying(SwathSonar(), 2.0, 1.0, 5.0, 0.06)


@pytest.mark.parametrize(("vehicles", "borders_m"), [(2, []), (3, [120.0]), (4, [80.0])])
def test_level_ground_of_four_lines_is_shared_in_whole_ones(vehicles: int, borders_m: list[float]) -> None:
    """Though nothing but the corner that they begin in is known: each line sees 40 m."""
    wanted = np.ones((160, 220), bool)
    depth = np.full(wanted.shape, np.nan)
    depth[:20, :8] = 14.0
    coverage = Coverage(0.0, 0.0, 1.0, wanted, np.isfinite(depth), depth)
    team = {f"v{k}": np.array([2.0 + 5.0 * k, 2.0, np.nan]) for k in range(vehicles)}
    sweeps = {name: Assignment() for name in team}
    share_out(sweeps, Rasters(1.0, 7.0).of(coverage, 0.0), FLYING, team)
    shares = [sweep.share for sweep in sweeps.values()]
    assert all(share is not None for share in shares), "a line for each"
    assert sorted({share.low_m for share in shares if share is not None})[1:] == pytest.approx(borders_m, abs=1.0)
