"""Lines of swath sonars beside keep-out zones."""

import math
from itertools import pairwise

import numpy as np

from app.estimation.swath import SwathSonar
from app.exploration.core.constraints import Constraints
from app.exploration.core.coverage import Coverage
from app.exploration.core.free_space import FreeSpace
from app.exploration.swath.near_zones import BarredGround, led_round
from app.exploration.swath.raster import Flying
from app.exploration.swath.survey import SwathSurvey

AREA = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]])
ZONE = np.array([[40.0, 40.0], [60.0, 40.0], [60.0, 60.0], [40.0, 60.0]])
LIMITS = Constraints(area=AREA, keep_out=(ZONE,))


def grid(depth_m: float) -> Coverage:
    wanted = np.ones((100, 100), dtype=bool)
    return Coverage(0.0, 0.0, 1.0, wanted, np.zeros_like(wanted), np.full(wanted.shape, depth_m))


def flying(depth_m: float = 2.0) -> Flying:
    return Flying(SwathSonar(math.radians(120.0)), depth_m, 1.0, 5.0, 0.06)


def test_what_no_swath_reaches_from_outside_of_a_zone_is_not_asked_for() -> None:
    coverage = grid(4.0)
    half_m = float(flying().half_width_m(np.array([4.0]))[0])
    seen = BarredGround(LIMITS, coverage).within_sight(coverage, flying())
    assert not seen.wanted[50, 50]
    assert seen.wanted[50, 41]
    left = np.argwhere(coverage.wanted & ~seen.wanted) + 0.5
    assert len(left) > 100
    to_border = np.minimum(np.minimum(left - 40.0, 60.0 - left).min(axis=1), np.inf)
    assert to_border.min() > half_m - 1.0
    unknown = grid(np.nan)
    assert BarredGround(LIMITS, unknown).within_sight(unknown, flying()).wanted.all()


def test_a_line_across_a_zone_leads_round_it() -> None:
    space = FreeSpace(LIMITS, 0.0)
    led = led_round(np.array([[50.0, 0.0], [50.0, 50.0], [50.0, 100.0]]), space)
    assert np.allclose(led[[0, -1]], [[50.0, 0.0], [50.0, 100.0]])
    for a, b in pairwise(led):
        middle = 0.5 * (a + b)
        assert not ((middle > 40.0 + 1e-6) & (middle < 60.0 - 1e-6)).all()
    inside = led_round(np.array([[41.0, 50.0], [41.5, 50.0]]), space)
    assert len(inside) == 1


def test_a_line_that_begins_behind_a_zone_is_reached_round_it() -> None:
    coverage = grid(12.0)
    survey = SwathSurvey(0.5 * math.pi, 1.0, 12.0, space=FreeSpace(LIMITS, 0.0))
    # Everything but a piece behind the zone is seen.
    done = np.ones_like(coverage.wanted)
    done[70:90, 45:55] = False
    coverage = Coverage(0.0, 0.0, 1.0, coverage.wanted, done, coverage.depth_m)
    pose = np.array([50.0, 40.0, 0.0])
    for _ in range(30):
        end = survey.next_leg("a", pose, flying(), coverage, {"a": pose}, 10.0, 10.0)
        if end is None or end[1] > 60.0:
            break
        assert np.hypot(*(end - pose[:2])) > 0.1
        assert not ((end > 40.0 + 1e-6) & (end < 60.0 - 1e-6)).all()
        pose = np.array([*end, 0.0])
    assert end is not None
    assert end[1] > 60.0
