"""Planners beside lawnmower lines: the small version of ``benchmarks/planning/survey_teams.py``."""

import pytest

from benchmarks.planning.survey_teams import Run, TeamSurvey, figures, flown, ratio, rmse_m

SMALL = TeamSurvey(vehicles=2, side_m=80.0, minutes=5.0, cell_m=4.0)


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["cao", "lawnmower"])
def test_planners_are_judged_after_they_have_flown_nearly_all_of_their_way_and_had_a_map(planner: str) -> None:
    floor = SMALL.floor("smooth", 2)
    builder, last = flown(SMALL, planner, floor, 2)
    assert last.left_m / SMALL.vehicles < 0.05 * last.distance_m.mean()
    assert rmse_m(builder, floor) < 0.5 * floor.z_m.std()


def test_a_ratio_is_that_to_the_lawnmower_over_the_same_floor() -> None:
    runs = [
        Run("lawnmower", "slope", 2, 0.1, 0.0),
        Run("cao", "slope", 2, 0.2, 30.0),
        Run("lawnmower", "reef", 2, 1.0, 0.0),
        Run("cao", "reef", 2, 0.5, 10.0),
    ]
    found = figures(runs)
    assert list(found) == ["cao, all floors", "cao, slope", "cao, reef"]
    assert found["cao, all floors"].startswith("1.000 ± 0.693 of 2, worst 2.00, best 0.50; unflown 20 m")
    assert found["cao, reef"].startswith("0.500 of 1,")


def test_a_mean_of_ratios_is_geometric() -> None:
    assert ratio([0.25, 4.0, 1.0]).startswith("1.000 ± 0.800 of 3,")
