"""Tracks are adjusted where the terrain tells by how much, and only there."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from app.arrays import FloatArray
from app.estimation.adjustment import AdjustedTracks, DriftModel, Fixes, TrackSoundings, adjusted, drift, thinned
from app.estimation.adjustment.drift import DriftNodes
from app.estimation.adjustment.least_squares import LeastSquares, WeighedTies
from app.estimation.adjustment.ties import Outcome, Tie

Bottom = Callable[[FloatArray, FloatArray], FloatArray]

OFF_M = np.array([3.0, -2.0])
"""By how much the second vehicle is off when its dive ends."""


def hills(east: FloatArray, north: FloatArray) -> FloatArray:
    return np.asarray(8.0 + np.sin(east / 4.0) * np.cos(north / 5.0) + 0.5 * np.sin((east + 2.0 * north) / 7.0))


def furrows(east: FloatArray, north: FloatArray) -> FloatArray:
    return np.asarray(8.0 + np.sin(east / 4.0) + 0.5 * np.cos(east / 2.3) + 0.0 * north)


def flat(east: FloatArray, north: FloatArray) -> FloatArray:
    return np.asarray(8.0 + 0.0 * east * north)


def swaths(bottom: Bottom) -> tuple[TrackSoundings, Fixes]:
    """What two vehicles sounded, one on lines to the north, one on lines to the east, of which the second drifts."""
    rng = np.random.default_rng(5)
    parts = []
    for number in (0, 1):
        time_s, along, across = [], [], []
        for k, line in enumerate(np.arange(4.0, 60.0, 8.0)):
            at = np.arange(0.0, 60.0, 1.0)
            beams = np.linspace(-6.0, 6.0, 13)
            time_s.append(np.repeat(80.0 * k + at, len(beams)))
            along.append(np.repeat(at, len(beams)))
            across.append(np.tile(line + beams, len(at)))
        at_s, north, east = (np.concatenate(column) for column in (time_s, along, across))
        if number:
            east, north = north, east
        depth = bottom(east, north) + 0.03 * rng.standard_normal(len(east))
        off = number * at_s[:, None] / at_s.max() * OFF_M
        sd = np.full(len(east), 0.03)
        of = np.full(len(east), number, dtype=np.int64)
        parts.append(TrackSoundings(of, at_s, east + off[:, 0], north + off[:, 1], depth, sd))
    soundings = thinned(TrackSoundings.joined(parts), 1.0, 5.0)
    begin, end = 0.0, float(soundings.time_s.max()) + 1.0
    fixes = Fixes(
        vehicle=np.array([0, 0, 1]),
        time_s=np.array([begin, end, begin]),
        east_m=np.zeros(3),
        north_m=np.zeros(3),
        sd_m=np.full(3, 0.1),
        resets=np.ones(3, dtype=bool),
    )
    return soundings, fixes


def offsets(found: AdjustedTracks) -> FloatArray:
    """How far the second vehicle's errors at its nodes are from what they are in truth, (m, 2)."""
    own = found.nodes.vehicle == 1
    time_s = found.nodes.time_s[own]
    return np.asarray(found.offset_m[own] - time_s[:, None] / time_s.max() * OFF_M)


@pytest.mark.slow
def test_hills_tell_how_a_vehicle_drifted() -> None:
    found = adjusted(*swaths(hills))
    assert found.by_ties
    assert np.sqrt(np.mean(offsets(found) ** 2)) < 0.25
    assert found.held_out is not None
    assert found.held_out.after_m < 0.5 * found.held_out.before_m
    assert found.sd_m.max() < 0.3 * found.before_sd_m.max()


@pytest.mark.slow
def test_furrows_tell_nothing_along_themselves() -> None:
    found = adjusted(*swaths(furrows))
    off = offsets(found)
    assert np.sqrt(np.mean(off[:, 0] ** 2)) < 0.3
    own = found.nodes.vehicle == 1
    sd = found.sd_m[own][-1]
    # The same terrain tells both how fast it drifts, and where across only.
    assert sd[1] > 2.0 * sd[0]


def test_a_flat_bottom_tells_nothing() -> None:
    found = adjusted(*swaths(flat))
    assert not found.by_ties
    assert np.abs(found.offset_m).max() < 1e-6
    assert not any(tie.outcome == "used" for tie in found.ties)


def test_nothing_is_adjusted_without_soundings() -> None:
    with pytest.raises(ValueError, match="no sounding"):
        adjusted(TrackSoundings.joined([]), Fixes.none())


NONE = ("walk_m", "rate_mph", "rate_time_s", "start_sd_m", "scale_sd", "heading_sd_rad")


@pytest.mark.parametrize("none", [*((name,) for name in NONE), NONE])
def test_an_error_that_there_is_not_is_left_out(none: tuple[str, ...]) -> None:
    """As a very small one is."""
    soundings, fixes = swaths(flat)
    soundings = soundings.take(np.flatnonzero(soundings.vehicle == 1)[::10])
    found = adjusted(soundings, fixes, replace(DriftModel(), **dict.fromkeys(none, 0.0)))
    near = adjusted(soundings, fixes, replace(DriftModel(), **dict.fromkeys(none, 1e-5)))
    assert np.isfinite(found.offset_m).all()
    assert (found.sd_m > 0.0).all()
    np.testing.assert_allclose(found.sd_m, near.sd_m, rtol=0.05, atol=0.01)


def test_fixes_and_sections_without_an_error_are_taken_at_their_word() -> None:
    soundings, fixes = swaths(hills)
    soundings = soundings.take(np.flatnonzero(soundings.vehicle == 1)[::10])
    found = adjusted(soundings, replace(fixes, sd_m=np.zeros(3)), offset_sd_m=0.0)
    assert np.isfinite(found.offset_m).all()
    assert (found.sd_m > 0.0).all()


@pytest.mark.parametrize("name", NONE)
def test_a_deviation_that_is_none_is_refused_by_name(name: str) -> None:
    soundings, fixes = swaths(flat)
    with pytest.raises(ValueError, match=f"{name}: -1.0 is no"):
        adjusted(soundings, fixes, replace(DriftModel(), **{name: -1.0}))
    with pytest.raises(ValueError, match="offset_sd_m: nan is no"):
        adjusted(soundings, fixes, offset_sd_m=np.nan)


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(
    off=st.tuples(st.floats(-20, 20), st.floats(-20, 20)),
    share=st.floats(0.05, 0.95),
    minutes=st.floats(5, 120),
)
def test_a_random_walk_between_two_fixes_is_a_straight_line(
    off: tuple[float, float], share: float, minutes: float
) -> None:
    end_s = 60.0 * minutes
    time_s = np.linspace(0.0, end_s, 50)
    level = np.zeros(50)
    soundings = TrackSoundings(np.zeros(50, np.int64), time_s, time_s, level, level + 5.0, level + 0.1)
    fixes = Fixes(
        vehicle=np.zeros(2, np.int64),
        time_s=np.array([0.0, end_s]),
        east_m=np.array([0.0, off[0]]),
        north_m=np.array([0.0, off[1]]),
        sd_m=np.full(2, 1e-3),
        resets=np.ones(2, dtype=bool),
    )
    found = adjusted(soundings, fixes, DriftModel(walk_m=5.0, rate_mph=1e-3))
    np.testing.assert_allclose(found.at(0, np.array([share * end_s]))[0], share * np.array(off), atol=0.01)


def test_thinned_soundings_are_means_without_spikes() -> None:
    rng = np.random.default_rng(1)
    depth = 5.0 + 0.01 * rng.standard_normal(40)
    depth[7] = 3.0
    ones, none = np.full(40, 0.5), np.zeros(40, np.int64)
    found = thinned(TrackSoundings(none, np.linspace(100.0, 104.0, 40), ones, ones, depth, 0.1 * ones), 1.0, 5.0)
    assert len(found) == 1
    assert found.depth_m[0] == pytest.approx(np.delete(depth, 7).mean(), abs=1e-6)
    assert 0.0 < found.sd_m[0] < 0.05


@pytest.mark.slow
def test_deviations_hold_whatever_vehicles_drift_by() -> None:
    """Positions that drift less or more than usual are nearly always within 1.96 deviations."""
    within = [share_within(times_usual) for times_usual in (0.5, 1.0, 1.7)]
    assert min(within) >= 0.9
    assert np.mean(within) <= 0.98


@pytest.mark.slow
def test_deviations_hold_on_long_lines_whose_heading_is_wrong() -> None:
    """What bends each line by metres and is gone at its end is not seen by fixes at both ends."""
    assert share_within(0.25, heading_sd_rad=0.01) >= 0.9


def share_within(times_usual: float, heading_sd_rad: float = 0.0) -> float:
    """How much of two vehicles' ways is within 1.96 deviations, of which only both ends are fixed.

    Where their headings are wrong they are lines of 250 m to and fro.
    """
    rng = np.random.default_rng(11)
    usual = DriftModel()
    end_s, step_s = 1200.0, 10.0
    time_s = np.arange(0.0, end_s + 1.0, step_s)
    n = len(time_s)
    level = np.zeros(2 * n)
    east = (250.0 - np.abs(1.2 * time_s % 500.0 - 250.0)) * (heading_sd_rad > 0.0)
    within = []
    for _ in range(8):
        rate_time_s = float(rng.choice([200.0, 600.0, 1200.0]))
        kept = np.exp(-step_s / rate_time_s)
        rate = rng.standard_normal((2, n, 2))
        for k in range(1, n):
            rate[:, k] = kept * rate[:, k - 1] + np.sqrt(1.0 - kept**2) * rate[:, k]
        walk = rng.standard_normal((2, n, 2)) * usual.walk_m * np.sqrt(step_s / 3600.0)
        error = times_usual * np.cumsum(walk + rate * usual.rate_mph / 3600.0 * step_s, axis=1)
        error[:, :, 1] += heading_sd_rad * rng.standard_normal((2, 1)) * east
        # It begins with the error of its fix.
        error += 0.3 * rng.standard_normal((2, 1, 2)) - error[:, :1]
        seen = error[:, -1] + 0.3 * rng.standard_normal((2, 2))
        of = np.repeat(np.arange(2), n)
        soundings = TrackSoundings(of, np.tile(time_s, 2), np.tile(east, 2), level, level + 5.0, level + 0.1)
        fixes = Fixes(
            vehicle=np.repeat(np.arange(2), 2),
            time_s=np.tile([0.0, end_s], 2),
            east_m=np.column_stack([np.zeros(2), seen[:, 0]]).ravel(),
            north_m=np.column_stack([np.zeros(2), seen[:, 1]]).ravel(),
            sd_m=np.full(4, 0.3),
            resets=np.ones(4, dtype=bool),
        )
        found = adjusted(soundings, fixes)
        inner = found.nodes.interpolation(of, np.tile(time_s, 2))
        left = error.reshape(-1, 2) - inner @ found.offset_m
        within.append(np.mean(np.abs(left) <= 1.96 * (inner @ found.sd_m)))
    return float(np.mean(within))


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(scale=st.floats(-0.005, 0.005), heading_rad=st.floats(-0.03, 0.03), course_rad=st.floats(-3.1, 3.1))
def test_a_wrong_heading_or_scale_seen_by_fixes_is_taken_out_of_the_whole_dive(
    scale: float, heading_rad: float, course_rad: float
) -> None:
    """What a vehicle is off by grows on its way out and goes on the way back, whichever way it goes."""
    time_s = np.arange(0.0, 801.0, 5.0)
    way = np.array([1.0, 0.2j]) @ np.array([100.0 - np.abs(time_s % 400.0 - 200.0) / 2.0, time_s / 8.0])
    way = way * np.exp(1.0j * course_rad)
    error = (way - way[0]) * complex(scale, heading_rad)
    n = len(time_s)
    of, level = np.zeros(n, np.int64), np.zeros(n)
    soundings = TrackSoundings(of, time_s, way.real, way.imag, level + 5.0, level + 0.1)
    at = np.searchsorted(time_s, [0.0, 200.0])
    fixes = Fixes(of[:2], time_s[at], error[at].real, error[at].imag, np.full(2, 1e-3), np.array([True, False]))
    still = DriftModel(walk_m=1e-2, rate_mph=1e-2)
    left = adjusted(soundings, fixes, still).at(0, time_s) @ (1.0, 1.0j) - error
    assert np.abs(left).max() < 0.05


@pytest.mark.parametrize("tied", [False, True])
def test_deviations_are_those_of_each_node_by_itself(tied: bool) -> None:
    soundings, fixes = swaths(hills)
    nodes = DriftNodes.along(soundings, fixes, 30.0)
    problem = LeastSquares(nodes, fixes, DriftModel())
    ties = WeighedTies.none()
    if tied:
        both = np.array([2, len(nodes) - 3])
        tie = Tie(np.zeros(2), np.diag([4.0, 1.0]), both, np.array([1.0, -1.0]), Outcome.USED, 0.0)
        ties = WeighedTies([tie], np.array([[0.5, -0.2]]), np.ones(1))
    solution = problem.solve(ties)
    each = problem.covariances(solution, sparse.csr_array(np.eye(len(nodes))))
    np.testing.assert_allclose(problem.deviations(solution) ** 2, np.einsum("kii->ki", each), rtol=1e-6)


def interrupted(silent_s: float) -> tuple[TrackSoundings, Fixes]:
    """What a vehicle sounded in two lines with a silence between, before which its place was known."""
    at_s = np.concatenate([np.arange(0.0, 300.0, 2.0), 300.0 + silent_s + np.arange(0.0, 300.0, 2.0)])
    along, one = np.tile(np.arange(0.0, 300.0, 2.0), 2), np.ones(len(at_s))
    soundings = TrackSoundings(np.zeros(len(at_s), dtype=np.int64), at_s, along, 20.0 * one, 9.0 * one, 0.1 * one)
    begin = [np.zeros(1), np.zeros(1), np.zeros(1), np.full(1, 0.1), np.ones(1, dtype=bool)]
    return soundings, Fixes(np.zeros(1, dtype=np.int64), *begin)


@pytest.mark.parametrize("hours", [1.0, 4.0])
def test_one_step_over_a_silence_drifts_as_many_small_ones(hours: float, monkeypatch: pytest.MonkeyPatch) -> None:
    once = adjusted(*interrupted(3600.0 * hours))
    monkeypatch.setattr(drift, "SILENT_S", np.inf)
    finely = adjusted(*interrupted(3600.0 * hours))
    assert len(once.nodes) < 40 < 100 < len(finely.nodes)
    at_once, in_small_steps = (
        found.sd_m[[int(np.argmin(np.abs(found.nodes.time_s - 300.0))), -1]] for found in (once, finely)
    )
    np.testing.assert_allclose(at_once, in_small_steps, rtol=0.01)


def test_a_clock_that_was_decades_off_makes_no_nodes_of_decades() -> None:
    found = adjusted(*interrupted(20_000 * 86_400.0))
    assert len(found.nodes) < 40
    assert np.isfinite(found.offset_m).all()
