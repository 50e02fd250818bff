"""From soundings to the map and the belief."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from app.mapping.gaussian_process import surveys
from app.mapping.swath.pings import Footprints, Pings, PlacedPings
from app.missions.maps import builder as builder_module
from app.missions.maps.builder import CLAIM_MARGIN, MAX_LANDMARKS, UNSEEN_MARGIN, MapBuilder, make_grid
from tests.support.missions.maps import AREA, built_of, soundings


def test_nothing_is_known_before_the_first_sounding() -> None:
    builder = MapBuilder(AREA, 1.0, 0.25)
    builder.add(np.zeros((0, 4)))
    assert builder.build() is None
    assert builder.build(thorough=True) is None
    builder.learn()
    belief = builder.belief()
    assert builder.coverage_pct() == 0.0
    assert not builder.stale
    assert np.isnan(belief.depth_m).all()
    assert np.isinf(belief.sd_m).all()
    assert len(belief.xy_m) == 900


def test_beams_that_all_fell_outside_of_the_area_make_no_map() -> None:
    builder = MapBuilder(AREA, 1.0, 0.25)
    zeros, angle, range_m = np.zeros(1), np.zeros((1, 1), np.float32), np.full((1, 1), 9.0, np.float32)
    pings = Pings(zeros, zeros, zeros, zeros, zeros, zeros, zeros, zeros, angle, range_m)
    off = Footprints(np.arange(1), np.array([-20.0]), np.array([5.0]), np.array([9.0]), zeros, np.array([9.0]))
    builder.swath.place = lambda vehicle, pings: PlacedPings(pings, off)
    builder.swath.add("rover", pings)
    assert builder.build() is None
    assert builder.own_map() is None


def test_a_map_of_its_own_soundings_knows_nothing_of_imported_ones() -> None:
    builder, plain = built_of(soundings(40)), built_of(soundings(40))
    builder.arrivals.replace_prior(soundings(300, seed=3) + np.array([0.0, 0.0, 2.0, 0.0]))
    fused = builder.build()
    own, expected = builder.own_map(), plain.own_map()
    assert fused is not None
    assert own is not None
    assert expected is not None
    np.testing.assert_array_equal(own.depth_m, expected.depth_m)
    np.testing.assert_array_equal(own.sd_m, expected.sd_m)
    assert np.abs(fused.map.depth_m - own.depth_m).max() > 0.03


@pytest.mark.parametrize("heavy", [1, 10**9], ids=["elsewhere", "here"])
def test_no_decision_waits_for_a_thorough_map(monkeypatch: pytest.MonkeyPatch, heavy: int) -> None:
    monkeypatch.setattr(builder_module, "HEAVY", heavy)
    builder = built_of(soundings(60))
    newest, begun, go_on = builder.newest, threading.Event(), threading.Event()

    def held(work: Callable[..., Any], *arguments: Any) -> Any:
        begun.set()
        assert go_on.wait(240)
        return work(*arguments)

    builder.elsewhere = held
    monkeypatch.setattr(builder_module, "_here", held)
    with ThreadPoolExecutor(1) as pool:
        thorough = pool.submit(builder.build, thorough=True)
        assert begun.wait(240)
        builder.add(soundings(5, seed=7))
        assert builder.build() is newest
        go_on.set()
        made = thorough.result()
    monkeypatch.undo()
    assert made is not None
    assert made.thorough
    after = builder.build()
    assert after is not None
    assert after.soundings == 65


def test_all_who_ask_for_a_thorough_map_at_the_same_time_get_one_that_is_made_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    judgements = []

    def judged(*arguments: Any) -> Any:
        judgements.append(arguments)
        return surveys.judged(*arguments)

    monkeypatch.setattr(builder_module, "judged", judged)
    builder = built_of(soundings(60))
    before = builder.newest
    with ThreadPoolExecutor(3) as pool:
        made = [asked.result() for asked in [pool.submit(builder.build, thorough=True) for _ in range(3)]]
    assert len(judgements) == 1
    assert made[0] is made[1] is made[2] is builder.newest is not before
    # What comes, or is replaced, is in the next one.
    builder.add(soundings(5, seed=7))
    more = builder.build(thorough=True)
    builder.arrivals.replace(soundings(40, seed=9), np.zeros((0, 4)))
    fewer = builder.build(thorough=True)
    assert more is not None
    assert fewer is not None
    assert (more.soundings, fewer.soundings) == (65, 40)
    assert len(judgements) == 3


def test_the_same_soundings_give_the_same_digest() -> None:
    first, again = built_of(soundings(60)), built_of(soundings(60))
    parts = built_of(*np.array_split(soundings(60), 4))
    assert first.newest is not None
    assert again.newest is not None
    assert parts.newest is not None
    assert first.newest.digest == again.newest.digest == parts.newest.digest
    other = built_of(soundings(61)).newest
    assert other is not None
    assert other.digest != first.newest.digest


def test_versions_grow_with_new_soundings_only() -> None:
    builder = built_of(soundings(40))
    first = builder.newest
    assert builder.build() is first
    builder.add(soundings(5, seed=1))
    assert builder.stale
    second = builder.build()
    assert first is not None
    assert second is not None
    assert (first.version, first.soundings) == (1, 40)
    assert (second.version, second.soundings) == (2, 45)
    assert not builder.stale


def test_the_map_is_that_of_the_sea_floor_and_the_belief_that_of_the_map() -> None:
    builder = built_of(soundings(150))
    builder.learn()
    builder.add(soundings(20, seed=1))
    newest = builder.build()
    assert newest is not None
    truth = 6.0 + 0.1 * builder.grid.centres_m[:, 0].reshape(30, 30)
    assert np.sqrt(np.mean((newest.map.depth_m - truth) ** 2)) < 0.05
    belief = builder.belief()
    np.testing.assert_array_equal(belief.depth_m, newest.map.depth_m.ravel())
    assert 0.0 < builder.coverage_pct() <= 100.0
    np.testing.assert_array_equal(belief.accurate, newest.map.known(0.25).ravel())
    np.testing.assert_array_equal(belief.sd_m, newest.map.planning_sd_m.ravel())
    assert builder.remaining_pct() == pytest.approx(100.0 - builder.coverage_pct())


def corner(count: int, seed: int) -> np.ndarray:
    """Soundings of a flat corner of 6 x 6 m."""
    east, north = np.random.default_rng(seed).uniform(0, 6, (2, count))
    return np.column_stack([east, north, np.full(count, 9.0), np.full(count, 0.05)])


def test_a_first_look_at_a_flat_corner_claims_nothing_of_the_rest() -> None:
    builder = built_of(corner(40, 3))
    builder.learn(always=True)
    builder.add(corner(2, 4))
    built = builder.build()
    assert built is not None
    belief = builder.belief()
    assert not belief.accurate[(belief.xy_m > 10.0).any(axis=1)].any()
    assert builder.coverage_pct() < 12.0
    assert builder.remaining_pct() > 88.0
    assert built.mean_sd_m > 0.5


def test_what_was_claimed_is_taken_back_when_more_soundings_contradict_it() -> None:
    builder = built_of(soundings(150))
    before = builder.belief().accurate
    assert before.any()
    spread = soundings(400, seed=8)
    spread[:, 2] += np.random.default_rng(9).normal(0.0, 4.0, 400)
    spread[:, 3] = 5.0
    builder.arrivals.replace(np.concatenate([soundings(3), spread]), np.zeros((0, 4)))
    builder.build()
    assert builder.belief().accurate.sum() < before.sum() / 2
    assert builder.remaining_pct() == pytest.approx(100.0 - builder.coverage_pct())


def margin(claim_sd_m: np.ndarray) -> float:
    return CLAIM_MARGIN + UNSEEN_MARGIN * float(np.isinf(claim_sd_m).mean())


def test_a_cell_becomes_known_with_a_margin_and_stays_so_up_to_the_accuracy() -> None:
    builder = built_of(soundings(30))
    first = builder.newest
    assert first is not None
    plain = builder.as_of(soundings(30), builder.swath).claim_sd_m
    np.testing.assert_allclose(first.map.claim_sd_m, margin(plain) * plain)
    builder.add(soundings(1, seed=4))
    second = builder.build()
    assert second is not None
    known = first.map.known(0.25)
    assert known.any()
    later = builder.as_of(builder.soundings, builder.swath).claim_sd_m
    np.testing.assert_allclose(second.map.claim_sd_m[known], later[known])
    np.testing.assert_allclose(second.map.claim_sd_m[~known], margin(later) * later[~known])


def test_soundings_that_come_while_a_map_is_built_are_in_the_next_one() -> None:
    builder = MapBuilder(AREA, 1.0, 0.25)
    batches = [soundings(7, seed) for seed in range(40)]
    added = threading.Event()

    def add_all() -> None:
        for batch in batches:
            builder.add(batch)
        added.set()

    with ThreadPoolExecutor(3) as pool:
        adding = pool.submit(add_all)
        versions = []
        while not added.is_set():
            for done in [pool.submit(builder.build), pool.submit(builder.build)]:
                built = done.result()
                versions.append(built.version if built else 0)
            pool.submit(builder.learn).result()
        adding.result()
    final = builder.build()
    assert final is not None
    assert final.soundings == 7 * 40
    assert versions == sorted(versions)
    np.testing.assert_array_equal(np.sort(builder.sounded_at_m()[0][:, 0]), np.sort(np.concatenate(batches)[:, 0]))


def test_one_gross_outlier_does_not_bend_a_product() -> None:
    rows = soundings(200)
    spoiled = np.vstack([rows, [[15.0, 15.0, 60.0, 0.05]]])
    builder = MapBuilder(AREA, 1.0, 0.25)
    builder.add(spoiled)
    built = builder.build(thorough=True)
    assert built is not None
    assert built.map.depth_m[15, 15] == pytest.approx(7.55, abs=0.2)


@pytest.mark.parametrize("cell_m", [0.2, 1.0, 5.0])
def test_landmarks_are_few_enough_and_lie_in_the_area(cell_m: float) -> None:
    triangle = np.array([[0.0, 0.0], [30.0, 0.0], [0.0, 30.0]])
    builder = MapBuilder(triangle, cell_m, 0.25)
    xy = builder.belief().xy_m
    assert 0 < len(xy) <= 1.3 * MAX_LANDMARKS
    assert (xy.sum(axis=1) <= 30.0).all()


def test_the_grid_covers_the_area_without_a_needless_cell() -> None:
    grid, inside = make_grid(AREA + 1e-7, 1.0)
    assert (grid.rows, grid.cols) == (30, 30)
    assert inside.all()
    grid, inside = make_grid(np.array([[0.0, 0.0], [10.5, 0.0], [0.0, 4.0]]), 2.0)
    assert (grid.rows, grid.cols) == (2, 6)
    assert inside[0, 0]
    assert not inside[1, 5]
