"""What missions claim to know on the way: the small version of ``benchmarks/mapping/claims.py``."""

import pytest

from benchmarks.mapping.claims import Survey, claims_of
from simulator.floors.seafloors import generate

SHORT = Survey(vehicles=2, steps=40, max_step_m=10.0, cell_m=2.0, spacing_m=1.0)


@pytest.mark.slow
@pytest.mark.parametrize(("family", "planner"), [("smooth", "lawnmower"), ("reef", "cao")])
def test_no_more_is_claimed_than_the_end_and_the_true_sea_floor_confirm(family: str, planner: str) -> None:
    found = claims_of(generate(family, 1, width_m=60.0, height_m=60.0), SHORT, planner)
    assert [claim.part for claim in found.claims][-3:] == [10, 20, 50]
    for claim in found.claims:
        assert claim.claimed_pct <= claim.confirmed_pct + 5.0, claim
        assert claim.claimed_pct < 1.0 or claim.right_pct >= 90.0, claim
        # Ten percent of the way is no survey of the area.
        assert claim.part > 10 or claim.claimed_pct < 20.0, claim
        assert claim.part > 10 or claim.mean_sd_m > 0.5 * claim.rmse_m, claim
    # What could be confirmed at all is claimed for the most part.
    assert found.claims[-1].claimed_pct > 0.5 * found.claims[-1].confirmed_pct > 2.0
    assert found.fall_pct < 5.0
