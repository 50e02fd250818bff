"""Shortest ways with a turning circle: they lead to the goal, are no longer than what a slow search finds, and obey."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.exploration.motion.dubins import TURN, WORDS, lengths_m, poses_along, shortest_way

COORDINATE = st.floats(-50.0, 50.0)
HEADING = st.floats(-math.pi, math.pi)
POSE = st.tuples(COORDINATE, COORDINATE, HEADING).map(np.array)
RADIUS = st.floats(0.5, 20.0)


def apart(a: float, b: float) -> float:
    return abs((a - b + math.pi) % (2 * math.pi) - math.pi)


@given(POSE, POSE, RADIUS)
def test_a_way_leads_to_its_goal(start: np.ndarray, goal: np.ndarray, radius_m: float) -> None:
    way = shortest_way(start, goal, radius_m)
    assert way.word in WORDS
    end = poses_along(start, way, radius_m, np.array([way.length_m]))[0]
    assert np.hypot(*(end[:2] - goal[:2])) < 1e-5 * (1 + radius_m)
    assert apart(end[2], goal[2]) < 1e-5
    assert way.length_m >= np.hypot(*(goal - start)[:2]) - 1e-8


@given(POSE, POSE, RADIUS)
def test_it_never_turns_tighter_than_the_circle(start: np.ndarray, goal: np.ndarray, radius_m: float) -> None:
    way = shortest_way(start, goal, radius_m)
    at = np.linspace(0.0, way.length_m, 400)
    poses = poses_along(start, way, radius_m, at)
    step = np.diff(at)
    moved = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    turned = np.abs(np.diff(poses[:, 2]))
    assert np.all(moved <= step + 1e-9)
    assert np.all(turned <= step / radius_m + 1e-9)


def flown(start: np.ndarray, word: str, pieces: tuple[float, ...], step: float = 1e-3) -> np.ndarray:
    """Integrate a way in small steps, radius 1."""
    east, north, heading = start
    for kind, length in zip(word, pieces, strict=True):
        n = max(1, math.ceil(length / step))
        for _ in range(n):
            heading += 0.5 * TURN[kind] * length / n
            east += math.sin(heading) * length / n
            north += math.cos(heading) * length / n
            heading += 0.5 * TURN[kind] * length / n
    return np.array([east, north, heading])


@pytest.mark.parametrize("word", WORDS)
def test_no_way_found_by_trying_is_shorter(word: str) -> None:
    rng = np.random.default_rng(WORDS.index(word))
    for _ in range(10):
        start = rng.uniform(-3, 3, 3)
        pieces = tuple(rng.uniform(0.2, 5.0, 3))
        goal = flown(start, word, pieces, 0.01)
        assert lengths_m(start, goal, 1.0) <= sum(pieces) + 1e-3


def test_each_word_is_the_shortest_somewhere() -> None:
    poses = np.array(list(product((-3.0, -1.0, 0.0, 1.0, 3.0), (-3.0, 0.0, 1.0, 4.0), np.linspace(-3, 3, 9))))
    found = {shortest_way(np.zeros(3), goal, 1.0).word for goal in poses}
    assert found == set(WORDS)


def test_many_lengths_at_once_are_those_one_by_one() -> None:
    rng = np.random.default_rng(0)
    start, goal = rng.uniform(-20, 20, (2, 50, 3))
    one_by_one = [shortest_way(a, b, 5.0).length_m for a, b in zip(start, goal, strict=True)]
    np.testing.assert_allclose(lengths_m(start, goal, 5.0), one_by_one)


def test_a_line_straight_ahead_is_flown_straight() -> None:
    way = shortest_way(np.array([0.0, 0.0, 0.5]), np.array([10 * math.sin(0.5), 10 * math.cos(0.5), 0.5]), 7.5)
    assert way.length_m == pytest.approx(10.0)
