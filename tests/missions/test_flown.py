"""What vehicles have flown, and what that comes to."""

import pytest

from app.missions.flown import Flown, Phase, efficiency_pct

LEG = ((0.0, 0.0), (0.0, 100.0))


def test_a_vehicle_begins_stopped_with_nothing_flown() -> None:
    begun = Flown()
    assert (begun.flown_m, begun.on_plan_m, begun.idle_s, begun.left_m) == (0.0, 0.0, 0.0, None)
    assert begun.phase is Phase.STOPPED


def test_legs_that_were_missed_are_counted_also_over_a_restart() -> None:
    flown = Flown()
    for reached in (True, False, True, False, False):
        (flown.reach_leg if reached else flown.miss_leg)()
    for counted in (flown, Flown.recall(flown.remember())):
        assert (counted.legs_reached, counted.legs_missed, counted.missed_last) == (2, 3, 2)


@pytest.mark.parametrize(
    ("start", "end", "on_plan"),
    [
        ((1.0, 10.0), (2.0, 20.0), True),
        ((3.0, 10.0), (6.0, 20.0), False),  # too far aside
        ((1.0, 20.0), (1.0, 10.0), False),  # back
        ((0.0, 10.0), (3.0, 11.0), False),  # across
        ((1.0, 10.0), (1.0, 10.0), False),
    ],
)
def test_way_counts_as_planned_along_the_leg(
    start: tuple[float, float], end: tuple[float, float], on_plan: bool
) -> None:
    flown = Flown()
    flown.add_way(start, end, LEG)
    assert flown.on_plan_m == (flown.flown_m if on_plan else 0.0)
    without = Flown()
    without.add_way(start, end, None)
    assert (without.flown_m, without.on_plan_m) == (flown.flown_m, 0.0)


def test_what_is_stored_is_counted_on() -> None:
    flown = Flown(flown_m=60.0, on_plan_m=50.0, idle_s=5.5, left_m=40.0, phase=Phase.SURVEY)
    assert Flown.recall(flown.remember()) == Flown(flown_m=60.0, on_plan_m=50.0, idle_s=5.5, left_m=40.0)
    assert Flown.recall(Flown().remember()) == Flown.recall(None) == Flown()


def test_efficiency_is_the_teams_and_unknown_before_anything_was_flown() -> None:
    assert efficiency_pct([]) is None
    assert efficiency_pct([Flown(), Flown(idle_s=3.0)]) is None
    assert efficiency_pct([Flown(300.0, 240.0), Flown(100.0, 100.0), Flown()]) == pytest.approx(85.0)
