"""``bathyfleet evaluate adjust`` on a small sea floor."""

import numpy as np
import orjson
import pytest

from app.evaluation.adjust.run import AdjustJob
from app.evaluation.adjust.world import DriftScenario, fly
from app.evaluation.runs.summary import summarise
from simulator.floors.seafloors import generate

FLOOR = generate("rugged", 8, width_m=60.0, height_m=60.0)


@pytest.mark.slow
def test_a_rugged_floor_is_mapped_better_after_the_adjustment() -> None:
    found = AdjustJob(DriftScenario(FLOOR, 6.0, seed=2)).run(lambda step: None)
    assert orjson.loads(orjson.dumps(found)) == found
    assert summarise([found])["all"]["rmse_ratio"]["mean"] == found["rmse_ratio"]
    assert found["by_ties"]
    assert found["position_error_ratio"] < 0.4
    assert found["rmse_ratio"] < 0.7
    assert found["ties_rms_ratio"] < 0.6


def test_vehicles_drift_from_their_first_fix_to_their_last() -> None:
    survey = fly(DriftScenario(FLOOR, 6.0, vehicles=3, swath=False, seed=1))
    again = fly(DriftScenario(FLOOR, 6.0, vehicles=3, swath=False, seed=1))
    np.testing.assert_array_equal(survey.soundings.depth_m, again.soundings.depth_m)
    ends = [survey.error_m[survey.vehicle == k][-1] for k in range(3)]
    for k in range(3):
        last = survey.fixes.vehicle == k
        assert survey.fixes.east_m[last][-1] == pytest.approx(ends[k][0], abs=2.0)
    # Where it takes itself to be is off by the drift, its depths are those of where it is.
    own = survey.soundings.take(survey.soundings.vehicle == 0)
    assert len(own) > 100
