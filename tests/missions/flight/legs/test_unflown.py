"""Legs that were not flown are kept until the planner is told."""

import numpy as np

from app.missions.flight.legs.unflown import UnflownLegs

A, B, C = np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([5.0, 6.0])


def test_what_is_taken_is_kept_no_longer_and_the_rest_is() -> None:
    legs = UnflownLegs()
    legs.add_of_order("a", [A])
    legs.add_of_order("a", [B])
    legs.add_barred("a", [C])
    assert legs.waits("a")
    ((vehicle, ends_m),) = legs.take_of_orders()
    assert vehicle == "a"
    assert ends_m.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert not legs.has_of_order("a")
    assert legs.waits("a"), "its barred leg"
    assert [(name, ends.tolist()) for name, ends in legs.take_barred()] == [("a", [[5.0, 6.0]])]
    assert not legs.waits("a")


def test_a_planner_that_fails_takes_only_what_it_was_told() -> None:
    legs = UnflownLegs()
    legs.add_barred("a", [A])
    legs.add_barred("b", [B])
    assert next(legs.take_barred())[0] == "a", "and it fails at that"
    assert [name for name in "ab" if legs.is_barred(name)] == ["b"]


def test_an_order_that_is_planned_anew_leaves_other_legs_as_they_are() -> None:
    legs = UnflownLegs()
    legs.add_of_order("a", [A])
    legs.add_of_order("b", [B])
    legs.add_barred("a", [C])
    legs.forget_order("a")
    assert [name for name, _ in legs.take_of_orders()] == ["b"]
    assert legs.is_barred_end("a", C)
    assert not legs.is_barred_end("a", A)
    assert not legs.is_barred_end("b", C)


def test_who_leaves_twice_before_the_planner_is_told_leaves_nothing_out() -> None:
    legs = UnflownLegs()
    legs.add_left_line("a", A, [B, C])
    legs.add_left_line("a", C, [])
    ((_, place_m, ends_m),) = legs.take_left_lines()
    assert (place_m.tolist(), ends_m.tolist()) == (A.tolist(), [B.tolist(), C.tolist()])


def test_who_had_no_legs_may_have_left_a_line() -> None:
    legs = UnflownLegs()
    assert not legs.any_left_line
    legs.add_left_line("a", A, [])
    assert legs.any_left_line
    ((vehicle, place_m, ends_m),) = legs.take_left_lines()
    assert (vehicle, place_m.tolist(), ends_m.shape) == ("a", [1.0, 2.0], (0, 2))
    assert not legs.any_left_line
