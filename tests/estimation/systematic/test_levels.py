"""Depth offsets and the water level's residual are found where lines cross, with deviations that hold."""

import numpy as np
import pytest

from app.estimation.systematic import CrossingDepths, level_errors

OFFSETS_M = np.array([0.12, -0.04, -0.08])


def crossed(
    seed: int,
    offsets_m: np.ndarray = OFFSETS_M,
    hours: float = 3.0,
    tide_m: float = 0.0,
    line_sd_m: float = 0.02,
    spikes: float = 0.0,
) -> CrossingDepths:
    """Lines of vehicles that take turns, all across each other; each line has an error of its own."""
    rng = np.random.default_rng(seed)
    lines = 36
    vehicle = np.arange(lines) % len(offsets_m)
    at = np.sort(rng.uniform(0.0, 3600.0 * hours, lines))
    off = offsets_m[vehicle] + rng.normal(0.0, line_sd_m, lines) + tide_m * np.sin(2.0 * np.pi * at / (3600.0 * 6.0))
    pair = np.array([(a, b) for a in range(lines) for b in range(a) if rng.random() < 0.3])
    difference = off[pair[:, 0]] - off[pair[:, 1]] + rng.normal(0.0, 0.03, len(pair))
    wrong = rng.random(len(pair)) < spikes
    difference[wrong] += rng.uniform(-3.0, 3.0, int(wrong.sum()))
    return CrossingDepths(vehicle[pair], pair, at[pair], difference)


@pytest.mark.parametrize("spikes", [0.0, 0.1], ids=["clean", "a tenth of them spikes"])
def test_offsets_between_vehicles_are_found(spikes: float) -> None:
    found = level_errors(crossed(1, spikes=spikes, hours=0.5))
    assert found is not None
    for vehicle, offset in found.offsets.items():
        assert offset.value == pytest.approx(OFFSETS_M[vehicle] - OFFSETS_M.mean(), abs=0.025)
        assert offset.sd < 0.03
    assert found.offsets[0].significance > 3.0
    assert found.level is None, "half an hour tells nothing of the tide"
    if not spikes:
        assert found.rms_after_m < 0.6 * found.rms_before_m


def test_without_errors_nothing_is_significant() -> None:
    loud = 0
    for seed in range(20):
        found = level_errors(crossed(seed, offsets_m=np.zeros(3)))
        assert found is not None
        assert found.level is not None
        loud += max(found.offsets[v].significance for v in range(3)) > 3.0 or found.level.significance > 4.0
    assert loud <= 1


def test_deviations_hold() -> None:
    scaled = []
    for seed in range(40):
        found = level_errors(crossed(seed, hours=0.5))
        assert found is not None
        scaled += [(found.offsets[v].value - OFFSETS_M[v] + OFFSETS_M.mean()) / found.offsets[v].sd for v in range(3)]
    assert 0.4 < np.std(scaled) < 1.2
    assert np.mean(np.abs(scaled) < 1.96) > 0.9


def test_a_residual_of_the_water_level_is_found() -> None:
    found = level_errors(crossed(3, hours=6.0, tide_m=0.2))
    assert found is not None
    assert found.level is not None
    truth = 0.2 * np.sin(2.0 * np.pi * found.node_s / (3600.0 * 6.0))
    assert np.abs(found.level_m - (truth - truth.mean())).max() < 0.08
    assert found.level.significance > 3.0
    assert found.rms_after_m < 0.5 * found.rms_before_m


def test_one_vehicle_tells_nothing_of_its_offset_and_no_crossing_tells_nothing() -> None:
    assert level_errors(crossed(1, offsets_m=np.array([0.3]), hours=0.5)) is None
    none = CrossingDepths(np.zeros((0, 2), int), np.zeros((0, 2), int), np.zeros((0, 2)), np.zeros(0))
    assert level_errors(none) is None


def test_vehicles_that_never_met_others_have_no_offset() -> None:
    alone = crossed(1, hours=0.5)
    apart = CrossingDepths(
        np.concatenate([alone.vehicle, np.full((9, 2), 7)]),
        np.concatenate([alone.line, np.array([[100 + i, 101 + i] for i in range(9)])]),
        np.concatenate([alone.time_s, np.zeros((9, 2))]),
        np.concatenate([alone.difference_m, np.full(9, 0.5)]),
    )
    found = level_errors(apart)
    assert found is not None
    assert sorted(found.offsets) == [0, 1, 2]
