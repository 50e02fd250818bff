"""The order and the directions in which lines are flown."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import BoolArray, FloatArray
from app.exploration.lines.flying_order import Order, flying_orders

START = np.array([[0.0, 0.0]])


def between_m(ends_m: FloatArray, order: Order) -> float:
    begins = [ends_m[number, int(back)] for number, back in order]
    ends = [ends_m[number, 1 - int(back)] for number, back in order]
    return sum(float(np.hypot(*(begin - end))) for begin, end in zip(begins[1:], ends[:-1], strict=True))


def ordered(ends_m: FloatArray, fixed: BoolArray | None = None, *, in_order: bool = False) -> list[Order]:
    may_turn = np.ones(len(ends_m), dtype=bool) if fixed is None else ~fixed
    lengths_m = np.hypot(*(ends_m[:, 1] - ends_m[:, 0]).T)
    return flying_orders(ends_m, lengths_m, may_turn, START, in_order=in_order)


def side_by_side(numbers: list[int]) -> FloatArray:
    return np.array([[[20.0 * k, 0.0], [20.0 * k, 300.0]] for k in numbers])


def test_lines_side_by_side_are_flown_there_and_back_in_their_order() -> None:
    orders = ordered(side_by_side(list(range(6))))
    assert [[number for number, _ in order] for order in orders] == [list(range(6))] * 2
    assert [[back for _, back in order] for order in orders] == [[False, True] * 3, [True, False] * 3]


def test_a_shuffled_plan_is_flown_as_it_lies_unless_its_order_is_to_be_kept() -> None:
    ends_m = side_by_side([3, 0, 5, 1, 4, 2])
    best = ordered(ends_m)[0]
    assert between_m(ends_m, best) == pytest.approx(5 * 20.0)
    kept = ordered(ends_m, in_order=True)
    assert [[number for number, _ in order] for order in kept] == [list(range(6))] * 2


def test_the_given_order_is_kept_where_another_would_save_hardly_anything() -> None:
    """Two lines are exchanged, which costs 40 m of 1800."""
    ends_m = side_by_side([0, 1, 3, 2, 4, 5])
    assert [number for number, _ in ordered(ends_m)[0]] == list(range(6))


def test_a_line_that_keeps_its_direction_is_never_flown_backwards() -> None:
    fixed = np.array([False, True, True, False, True, False])
    for order in ordered(side_by_side(list(range(6))), fixed):
        assert not any(back for number, back in order if fixed[number])
    all_fixed = ordered(side_by_side(list(range(6))), np.ones(6, dtype=bool))
    assert len(all_fixed) == 1, "the first one cannot be flown either way"


@given(
    corners=st.lists(st.tuples(*[st.integers(0, 400)] * 4), min_size=1, max_size=5),
    turning=st.lists(st.booleans(), min_size=5, max_size=5),
)
@settings(max_examples=40, deadline=None)
def test_every_line_is_in_the_order_once_and_few_lines_lie_nearly_as_well_as_they_can(
    corners: list[tuple[int, ...]], turning: list[bool]
) -> None:
    ends_m = np.array(corners, dtype=float).reshape(-1, 2, 2)
    fixed = np.array(turning[: len(ends_m)])
    lines_m = float(np.hypot(*(ends_m[:, 1] - ends_m[:, 0]).T).sum())
    orders = ordered(ends_m, fixed)
    assert 1 <= len(orders) <= 2
    for order in orders:
        assert sorted(number for number, _ in order) == list(range(len(ends_m)))
        assert not any(back for number, back in order if fixed[number])
    least_m = min(
        between_m(ends_m, list(zip(numbers, backs, strict=True)))
        for numbers in itertools.permutations(range(len(ends_m)))
        for backs in itertools.product(*[[False] if fixed[number] else [False, True] for number in numbers])
    )
    found_m = min(between_m(ends_m, order) for order in orders)
    assert lines_m + found_m <= 1.05 * (lines_m + 1.25 * least_m) + 1.0


def test_many_lines_are_ordered_too() -> None:
    rng = np.random.default_rng(0)
    begin = rng.uniform(0.0, 5000.0, (1000, 2))
    ends_m = np.stack([begin, begin + rng.uniform(-200.0, 200.0, (1000, 2))], axis=1)
    order = ordered(ends_m)[0]
    assert sorted(number for number, _ in order) == list(range(1000))
    assert between_m(ends_m, order) < 0.2 * between_m(ends_m, [(k, False) for k in range(1000)])


def test_no_lines_have_no_order() -> None:
    assert ordered(np.zeros((0, 2, 2))) == []
