"""What vehicles have flown, and what that comes to."""

import pytest

from app.missions.flown import Flown, Phase, efficiency_pct


def test_a_vehicle_begins_on_its_way_with_nothing_flown() -> None:
    begun = Flown()
    assert (begun.flown_m, begun.on_plan_m, begun.idle_s, begun.left_m) == (0.0, 0.0, 0.0, None)
    assert begun.phase is Phase.TRANSIT


def test_what_was_flown_adds_up_and_is_not_left_any_more() -> None:
    flown = Flown(left_m=100.0).after_way(60.0, on_plan_m=50.0).after_waiting(4.0).after_waiting(1.5)
    assert flown == Flown(flown_m=60.0, on_plan_m=50.0, idle_s=5.5, left_m=40.0)
    assert flown.after_way(70.0).left_m == 0.0
    assert Flown().after_way(5.0) == Flown(flown_m=5.0)


def test_what_is_left_takes_its_time() -> None:
    assert Flown().minutes_left(1.5) is None
    assert Flown(left_m=900.0).minutes_left(1.5) == pytest.approx(10.0)


def test_efficiency_is_the_teams_and_unknown_before_anything_was_flown() -> None:
    assert efficiency_pct([]) is None
    assert efficiency_pct([Flown(), Flown(idle_s=3.0)]) is None
    assert efficiency_pct([Flown(300.0, 240.0), Flown(100.0, 100.0), Flown()]) == pytest.approx(85.0)
