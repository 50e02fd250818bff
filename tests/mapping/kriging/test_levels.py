"""Two levels of soundings: nothing twice, nothing near left out."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from app.mapping.kriging.levels import two_levels
from app.mapping.types import Soundings


@settings(deadline=None)
@given(seed=st.integers(0, 200), n_fine=st.integers(1, 20), n_coarse=st.integers(0, 20))
def test_no_sounding_is_used_twice(seed: int, n_fine: int, n_coarse: int) -> None:
    rng = np.random.default_rng(seed)
    n = 150
    s = Soundings(rng.uniform(0, 20, n), rng.uniform(0, 20, n), rng.uniform(5, 9, n), np.full(n, 0.1))
    levels = two_levels(s, 0.5, 3.0)
    at = rng.uniform(0, 20, (9, 2))
    for row in levels.neighbours(at, n_fine, n_coarse):
        used = row[row >= 0]
        assert len(used) > 0
        assert len(used) <= n_fine + n_coarse
        fine = used[used < levels.n_fine]
        inside = [
            m
            for g in used[used >= levels.n_fine] - levels.n_fine
            for m in levels.members[levels.start[g] : levels.start[g + 1]]
        ]
        assert len(set(fine) | set(inside)) == len(fine) + len(inside)


def test_the_nearest_soundings_are_single_and_far_tracks_are_reached() -> None:
    east, north = (a.ravel() for a in np.meshgrid(np.arange(5.0, 100.0, 10.0), np.arange(0.0, 100.0, 0.5)))
    levels = two_levels(Soundings(east, north, 0 * east + 9, 0 * east + 0.1), 1.0, 3.0)
    (row,) = levels.neighbours(np.array([[50.0, 50.0]]), 16, 32)
    row = row[row >= 0]
    points = levels.points[row]
    distance = np.linalg.norm(points - [50.0, 50.0], axis=1)
    assert distance[row < levels.n_fine].max() < distance[row >= levels.n_fine].max()
    assert len(np.unique(np.round(points[:, 0]))) >= 4


def test_all_precision_is_in_both_levels() -> None:
    rng = np.random.default_rng(0)
    s = Soundings(rng.uniform(0, 9, 60), rng.uniform(0, 9, 60), rng.uniform(5, 9, 60), rng.uniform(0.1, 0.3, 60))
    levels = two_levels(s, 0.5, 3.0)
    weight = levels.soundings.sd_m**-2.0
    np.testing.assert_allclose(weight[: levels.n_fine].sum(), np.sum(s.sd_m**-2.0))
    np.testing.assert_allclose(weight[levels.n_fine :].sum(), np.sum(s.sd_m**-2.0))


def test_what_lies_within_the_radius_is_not_used() -> None:
    rng = np.random.default_rng(1)
    s = Soundings(rng.uniform(0, 30, 400), rng.uniform(0, 30, 400), rng.uniform(5, 9, 400), np.full(400, 0.1))
    levels = two_levels(s, 0.5, 3.0)
    at, radius = rng.uniform(0, 30, (12, 2)), rng.uniform(0.1, 6.0, 12)
    for row, place, r in zip(levels.neighbours_beyond(at, radius, 16, 32), at, radius, strict=True):
        used = row[row >= 0]
        fine = [i for i in used if i < levels.n_fine]
        for g in used[used >= levels.n_fine] - levels.n_fine:
            fine.extend(levels.members[levels.start[g] : levels.start[g + 1]])
        assert len(fine) == len(set(fine)) >= 16
        assert np.linalg.norm(levels.points[fine] - place, axis=1).min() >= r


def test_beyond_an_edge_nothing_before_it_is_used() -> None:
    rng = np.random.default_rng(2)
    s = Soundings(rng.uniform(0, 30, 400), rng.uniform(0, 30, 400), rng.uniform(5, 9, 400), np.full(400, 0.1))
    levels = two_levels(s, 0.5, 3.0)
    at, before, course = rng.uniform(10, 20, (12, 2)), rng.uniform(0.0, 6.0, 12), rng.uniform(0, 2 * np.pi, 12)
    towards = np.column_stack([np.cos(course), np.sin(course)])
    for row, place, r, u in zip(levels.neighbours_beyond(at, before, 16, 8, towards), at, before, towards, strict=True):
        used = row[row >= 0]
        fine = [i for i in used if i < levels.n_fine]
        for g in used[used >= levels.n_fine] - levels.n_fine:
            fine.extend(levels.members[levels.start[g] : levels.start[g + 1]])
        assert len(fine) == len(set(fine)) >= 8
        along = (levels.points[fine] - place) @ u
        assert along.min() >= r
        every = (levels.points[: levels.n_fine] - place) @ u >= r
        nearest = np.linalg.norm(levels.points[: levels.n_fine][every] - place, axis=1).min()
        assert np.linalg.norm(levels.points[fine] - place, axis=1).min() <= nearest + 3.0 * np.sqrt(2)
