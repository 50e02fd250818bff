"""Sound speed casts from what a vehicle measured on its way."""

import numpy as np
import pytest

from app.arrays import FloatArray
from app.mapping.water.measured_casts import MOST_CASTS, MeasuredCast, SoundSpeedSamples, measured_casts


def speed_mps(depth_m: FloatArray) -> FloatArray:
    """Warm water on cold."""
    return np.asarray(np.where(depth_m < 8.0, 1510.0, 1495.0) - 0.1 * depth_m, dtype=np.float64)


def dive(
    begin_s: float, depth_m: FloatArray, rng: np.random.Generator | None = None, every_s: float = 1.0
) -> SoundSpeedSamples:
    noise = np.zeros(len(depth_m)) if rng is None else 0.3 * rng.standard_normal(len(depth_m))
    time_s = begin_s + every_s * np.arange(len(depth_m), dtype=np.float64)
    place = np.full(len(depth_m), 41.185), np.full(len(depth_m), -8.705)
    return SoundSpeedSamples(time_s, depth_m, speed_mps(depth_m) + noise, *place)


def joined(*parts: SoundSpeedSamples) -> SoundSpeedSamples:
    columns = ("time_s", "depth_m", "speed_mps", "lat_deg", "lon_deg")
    return SoundSpeedSamples(*(np.concatenate([getattr(part, name) for part in parts]) for name in columns))


DOWN_AND_UP = np.concatenate([np.linspace(0.0, 20.0, 300), np.full(600, 20.0), np.linspace(20.0, 0.0, 300)])


def of(samples: SoundSpeedSamples) -> MeasuredCast:
    [cast] = measured_casts(samples)
    return cast


def test_of_a_probe_that_lags_behind_only_the_way_down_counts() -> None:
    depths = np.concatenate([np.linspace(0.5, 20.0, 300), np.linspace(20.0, 0.5, 300)])
    dived = dive(1e9, depths)
    lagging = SoundSpeedSamples(
        dived.time_s,
        depths,
        np.where(np.arange(600) < 300, dived.speed_mps, dived.speed_mps + 3.0),
        dived.lat_deg,
        dived.lon_deg,
    )
    cast = of(lagging)
    assert cast.lag_mps == pytest.approx(-3.0, abs=0.1)
    assert cast.samples == pytest.approx(300, abs=2)
    inner = [(depth, speed) for depth, speed in cast.profile if abs(depth - 8.0) > 0.6]
    assert [speed for _, speed in inner] == pytest.approx([float(speed_mps(np.array(d))) for d, _ in inner], abs=0.1)
    steady = of(dived)
    assert steady.samples == 600, "a probe that does not lag counts both ways"
    assert sum(count for count, _ in steady.bins) == pytest.approx(600, abs=2)


def test_a_dive_tells_the_water_that_it_went_through() -> None:
    rng = np.random.default_rng(4)
    cast = of(dive(1e9, DOWN_AND_UP, rng))
    depths, speeds = np.array(cast.profile).T
    assert (np.diff(depths) > 0.0).all()
    assert (depths[0], depths[-1]) == (pytest.approx(0.4, abs=0.3), pytest.approx(20.0, abs=0.1))
    assert len(depths) == pytest.approx(40, abs=2)
    away = np.abs(depths - 8.0) > 0.5
    np.testing.assert_allclose(speeds[away], speed_mps(depths)[away], atol=0.3)
    assert cast.sd_mps == pytest.approx(0.3, abs=0.1)
    assert cast.time_s == pytest.approx(1e9 + 600.0, abs=60.0)
    assert (cast.lat_deg, cast.lon_deg) == (41.185, -8.705)


def test_what_cannot_be_sound_in_water_is_left_out_and_single_errors_change_no_median() -> None:
    good = dive(1e9, DOWN_AND_UP)
    expected = of(good)
    wrong = dive(1e9 + 0.5, DOWN_AND_UP[::40])
    for speeds in (np.full(30, -1.0), np.full(30, 340.0), np.full(30, np.nan), np.full(30, np.inf)):
        some = SoundSpeedSamples(wrong.time_s, wrong.depth_m, speeds, wrong.lat_deg, wrong.lon_deg)
        assert of(joined(good, some)) == expected
    off = SoundSpeedSamples(wrong.time_s, wrong.depth_m, wrong.speed_mps + 60.0, wrong.lat_deg, wrong.lon_deg)
    for (_, found), (_, known) in zip(of(joined(good, off)).profile, expected.profile, strict=True):
        assert found == pytest.approx(known, abs=1.0)


def test_a_new_cast_begins_after_a_pause_and_each_hour_where_it_covers_the_water() -> None:
    second = 1e9 + 3.0 * 3600.0
    both = measured_casts(joined(dive(second, DOWN_AND_UP), dive(1e9, DOWN_AND_UP)))
    assert [cast.samples for cast in both] == [both[0].samples] * 2, "in the order of their times, however they came"
    assert both[1].time_s - both[0].time_s == pytest.approx(3.0 * 3600.0)
    # A vehicle that keeps its depth for hours in between tells nothing new of the rest of the water.
    level = dive(1e9 + 1200.0, np.full(4 * 3600, 20.0))
    kept = measured_casts(joined(dive(1e9, DOWN_AND_UP), level, dive(1e9 + 1200.0 + 4 * 3600.0, DOWN_AND_UP)))
    assert 1 <= len(kept) <= 2
    assert all(cast.profile[0][0] < 1.0 and cast.profile[-1][0] > 19.0 for cast in kept)
    yo_yo = dive(1e9, np.tile(DOWN_AND_UP, 100))
    many = measured_casts(yo_yo)
    assert 12 <= len(many) <= MOST_CASTS
    assert sum(cast.samples for cast in many) == int((yo_yo.depth_m >= 0.3).sum())


@pytest.mark.parametrize(
    "depth_m", [np.zeros(0), np.full(500, 3.0), np.linspace(2.0, 3.5, 400), np.zeros(300), np.array([1.0, 20.0])]
)
def test_what_covers_no_water_is_no_cast(depth_m: FloatArray) -> None:
    assert measured_casts(dive(1e9, depth_m)) == []
