"""What is foretold of a survey, beside what is flown: in every direction of lines, from every side."""

import math

import numpy as np
import pytest

from app.arrays import FloatArray
from app.estimation.swath import SwathSonar
from app.evaluation.coverage import surveys
from app.evaluation.coverage.world import CRUISE_M, CoverageScenario, Fleet, outcome
from app.exploration.core.coverage import Coverage
from app.exploration.swath import survey
from app.exploration.swath.lines_ahead import ahead, best_direction
from app.exploration.swath.raster import Flying, raster_of
from simulator.floors.terrain import Terrain

FLYING = Flying(SwathSonar(), 2.0, 1.0, 5.0, 0.06)
DIRECTIONS_DEG = (0, 60, 90, 120, 150)


def flat(rows: int, cols: int, depth_m: float | FloatArray = 20.0) -> Coverage:
    depth = np.broadcast_to(np.asarray(depth_m, dtype=np.float64), (rows, cols)).copy()
    return Coverage(0.0, 0.0, 1.0, np.ones((rows, cols), bool), np.zeros((rows, cols), bool), depth)


def slope(width_m: int, height_m: int, shoal_m: float, deep_m: float, towards_rad: float) -> Terrain:
    north, east = np.mgrid[0:height_m, 0:width_m] + 0.5
    at = east * math.cos(towards_rad) + north * math.sin(towards_rad)
    return Terrain(shoal_m + (deep_m - shoal_m) * (at - at.min()) / np.ptp(at), 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("width_m", "height_m", "deep_m", "towards_rad", "vehicles"),
    [(160, 200, 35.0, 2.2, 1), (200, 160, 35.0, 0.7, 2), (140, 110, 8.0, 0.0, 1)],
    ids=["slope", "slope by two", "nearly level"],
)
def test_what_is_foretold_is_flown_whichever_way_lines_lie(
    width_m: int,
    height_m: int,
    deep_m: float,
    towards_rad: float,
    vehicles: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Directions are compared by these lengths: they may not lie off by direction. All depths are known."""
    shoal_m = 5.0 if deep_m > 10.0 else 7.5
    terrain = slope(width_m, height_m, shoal_m, deep_m, towards_rad)
    scenario = CoverageScenario(terrain, vehicles, SwathSonar(beams=64), 1.5)
    fleet = Fleet(scenario)
    coverage = fleet.coverage(scenario.true_depth_m())
    team = {name: craft.pose for name, craft in fleet.crafts.items()}
    for gain in ("TURNING_GAIN", "TURNING_TEAM_GAIN"):
        monkeypatch.setattr(survey, gain, 1.0)  # Lines stay in the direction that they are given.
    ratios = []
    for direction_rad in np.radians(DIRECTIONS_DEG):
        _, foretold_m = best_direction(coverage, scenario.flying, CRUISE_M + 5.0, direction_rad, 1.0, team, 1.5)
        monkeypatch.setattr(surveys, "longer_axis_rad", lambda _, direction_rad=direction_rad: direction_rad)
        ratios.append(foretold_m / 1000.0 / outcome(surveys.fly_ours(scenario, known=True)).km)
    off = np.abs(np.array(ratios) / np.median(ratios) - 1.0)
    assert off.mean() < 0.1


@pytest.mark.parametrize("vehicles", [1, 2, 3])
def test_lines_that_are_too_long_in_all_are_not_laid_to_the_end(vehicles: int) -> None:
    raster = raster_of(flat(150, 150, 8.0), 0.0, 2.0, 10.0)
    team = {f"v{k}": np.array([5.0 * k, 0.0, np.nan]) for k in range(vehicles)}
    whole = ahead(raster, FLYING, team)
    assert whole is not None
    assert ahead(raster, FLYING, team, whole.length_m - 1.0) is None
    again = ahead(raster, FLYING, team, whole.length_m + 1.0)
    assert again is not None
    assert again.length_m == whole.length_m


@pytest.mark.parametrize("vehicles", [1, 2, 3])
def test_all_lines_together_see_everything_and_are_as_long_as_needed(vehicles: int) -> None:
    raster = raster_of(flat(180, 300), 0.0, 1.0, 10.0)
    team = {f"v{k}": np.array([5.0 * k, 0.0, np.nan]) for k in range(vehicles)}
    found = ahead(raster, FLYING, team)
    assert found is not None
    assert len(found.paths) == 3, "62 m of swath on 180 m"
    assert 900.0 < found.length_m < 1200.0 + 300.0 * (vehicles - 1)
    assert raster.open.all(), "foretelling changes nothing"


def test_a_sweep_that_begins_above_a_slope_is_foretold_as_it_is_flown_from_there() -> None:
    """Lines follow the edge of the last one: from the other side they are others."""
    depth = np.add.outer(np.linspace(5.0, 20.0, 160), np.linspace(0.0, 15.0, 200))
    raster = raster_of(flat(160, 200, depth), 0.0, 1.5, 10.0)
    below, above = (ahead(raster, FLYING, {"a": np.array([0.0, north, np.nan])}) for north in (0.0, 160.0))
    assert below is not None
    assert above is not None
    assert below.paths[0][:, 1].mean() < 50.0
    assert above.paths[0][:, 1].mean() > 110.0


def test_missed_ground_is_foretold_as_passes_on_the_way_and_scraps_not_at_all() -> None:
    """A shoal between two lines that see it in part."""
    coverage = flat(120, 200)
    coverage.done[:60] = True
    coverage.done[20:26, 90:96] = False
    team = {"a": np.array([0.0, 60.0, 0.5 * math.pi])}
    raster = raster_of(coverage, 0.0, 1.0, 10.0)
    whole = ahead(raster, FLYING, team)
    alone = ahead(raster, FLYING, team, least_m2=49.0)
    assert whole is not None
    assert alone is not None
    assert 5.0 < whole.length_m - alone.length_m < 200.0
    assert whole.paths[0] == pytest.approx(alone.paths[0])


def test_lines_lie_along_the_contours_of_a_slope() -> None:
    depth = np.tile(np.linspace(5.0, 40.0, 200), (200, 1))
    team = {"a": np.array([0.0, 0.0, np.nan])}
    direction, length_m = best_direction(flat(200, 200, depth), FLYING, 10.0, 0.0, 0.05, team)
    assert abs(math.cos(direction)) < 0.5, "north and south, where the depth changes eastwards"
    assert length_m > 0.0
    same, _ = best_direction(flat(100, 300), FLYING, 10.0, 0.0, 0.05, team)
    assert same == 0.0
