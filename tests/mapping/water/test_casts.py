"""Which of several casts corrects a ping, beside plain search; beams through it, beside slow integration."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.pings import Pings, placed
from app.mapping.water.casts import CastPlaces, CastRule, Casts, depth_difference_m
from app.mapping.water.sound_speed import SoundSpeedProfile

ASSUMED_MPS = 1500.0
SPEEDS = ([1520.0, 1500.0, 1490.0], [1515.0, 1511.0, 1509.0], [1480.0, 1485.0, 1495.0])
DEPTHS = np.array([0.0, 8.0, 30.0])
PROFILES = [SoundSpeedProfile(DEPTHS, np.array(speeds), ASSUMED_MPS) for speeds in SPEEDS]

Cast = tuple[float, float, float]
"""Time in seconds, east and north in metres."""


def casts_of(known: list[Cast], rule: CastRule, within_s: float = math.inf) -> Casts:
    times, east, north = (np.array(column) for column in zip(*known, strict=True))
    profiles = [PROFILES[number % len(PROFILES)] for number in range(len(known))]
    return Casts(profiles, CastPlaces(times, east, north), rule, within_s)


def searched(known: list[Cast], rule: CastRule, within_s: float, ping: Cast) -> int:
    """The rule as a surveyor says it, one cast after the other."""

    def away_s(number: int) -> float:
        return abs(known[number][0] - ping[0])

    def away_m(number: int) -> float:
        return math.dist(known[number][1:], ping[1:])

    numbers = range(len(known))
    near = [number for number in numbers if away_s(number) <= within_s]
    if rule is CastRule.NEAREST_IN_DISTANCE and near:
        return min(near, key=lambda number: (away_m(number), away_s(number), number))
    return min(numbers, key=lambda number: (away_s(number), known[number][0], number))


# Whole numbers: as near is then as near, and not a matter of the last digit.
seconds, metres = st.integers(0, 50).map(float), st.integers(-4, 4).map(lambda n: 100.0 * n)
events = st.lists(st.tuples(seconds, metres, metres), min_size=1, max_size=7)


@given(events, events, st.sampled_from(CastRule), st.integers(0, 30))
def test_each_ping_has_the_cast_that_a_search_of_all_finds(
    known: list[Cast], pings: list[Cast], rule: CastRule, within_s: int
) -> None:
    chosen = casts_of(known, rule, within_s).chosen(*(np.array(column) for column in zip(*pings, strict=True)))
    assert chosen.tolist() == [searched(known, rule, within_s, ping) for ping in pings]


@given(events, events, st.sampled_from(CastRule), st.integers(0, 30), st.data())
def test_casts_in_another_order_correct_alike(
    known: list[Cast], pings: list[Cast], rule: CastRule, within_s: int, data: st.DataObject
) -> None:
    known = list({cast[0]: cast for cast in known}.values())  # of two at the same time the first counts
    order = data.draw(st.permutations(range(len(known))))
    columns = [np.array(column) for column in zip(*pings, strict=True)]
    chosen = casts_of(known, rule, within_s).chosen(*columns)
    other = casts_of([known[number] for number in order], rule, within_s).chosen(*columns)
    away = [math.dist(known[one][1:], ping[1:]) for one, ping in zip(chosen, pings, strict=True)]
    assert away == [math.dist(known[order[one]][1:], ping[1:]) for one, ping in zip(other, pings, strict=True)]


def test_where_no_place_is_known_the_nearest_in_time_corrects() -> None:
    casts = casts_of([(0.0, 0.0, 0.0), (100.0, 0.0, 0.0)], CastRule.NEAREST_IN_DISTANCE, 1000.0)
    unknown = np.full(2, np.nan)
    assert casts.chosen(np.array([10.0, 90.0]), unknown, unknown).tolist() == [0, 1]


def in_small_steps(speeds: list[float], sonar_m: float, angle_rad: float, time_s: float) -> tuple[float, float]:
    """Snell's law, midpoint rule: across and down."""
    dt = time_s / 2000
    depth, across = sonar_m, 0.0
    p = math.sin(angle_rad) / np.interp(depth, DEPTHS, speeds)
    for _ in range(2000):
        c = np.interp(depth, DEPTHS, speeds)
        c = np.interp(depth + 0.5 * dt * c * math.sqrt(1 - (p * c) ** 2), DEPTHS, speeds)
        depth += dt * c * math.sqrt(1 - (p * c) ** 2)
        across += dt * c * p * c
    return across, depth - sonar_m


def pings_at(times: list[float], frame: LocalFrame) -> Pings:
    count = len(times)
    zeros = np.zeros(count)
    angles = np.radians(np.tile([-60.0, 0.0, 60.0], (count, 1))).astype(np.float32)
    return Pings(
        time_s=np.array(times),
        lat_deg=np.full(count, frame.origin_lat_deg),
        lon_deg=np.full(count, frame.origin_lon_deg),
        depth_m=np.full(count, 2.0),
        roll_rad=zeros,
        pitch_rad=zeros,
        heading_rad=zeros,
        position_sd_m=np.full(count, np.nan),
        angle_rad=angles,
        range_m=np.where(np.abs(angles) > 0.1, 40.0, 20.0).astype(np.float32),
    )


@pytest.mark.parametrize("rule", CastRule)
def test_beams_go_through_the_cast_of_their_ping(rule: CastRule) -> None:
    frame = LocalFrame(41.0, -8.0)
    known = [(0.0, 500.0, 0.0), (1000.0, 100.0, 0.0), (5000.0, 10.0, 0.0)]
    times = [0.0, 499.0, 501.0, 2000.0, 2999.0, 3001.0, 9000.0]
    found = placed(pings_at(times, frame), frame, casts_of(known, rule, 2500.0))
    for beam in range(len(found)):
        ping = int(found.ping[beam])
        number = searched(known, rule, 2500.0, (times[ping], 0.0, 0.0))
        angle = float(found.angle_rad[beam])
        across, down = in_small_steps(list(SPEEDS[number]), 2.0, abs(angle), float(found.range_m[beam]) / ASSUMED_MPS)
        assert found.depth_m[beam] == pytest.approx(2.0 + down, abs=1e-4)
        assert found.east_m[beam] == pytest.approx(math.copysign(across, angle), abs=1e-4)


@given(st.lists(seconds, min_size=1, max_size=6), st.lists(seconds, min_size=1, max_size=20))
def test_casts_that_are_equal_change_nothing_to_the_last_bit(cast_s: list[float], times: list[float]) -> None:
    frame = LocalFrame(41.0, -8.0)
    pings, nowhere = pings_at(times, frame), np.full(len(cast_s), np.nan)
    alike = [SoundSpeedProfile(DEPTHS.copy(), np.array(SPEEDS[0]), ASSUMED_MPS) for _ in cast_s]
    alone = Casts(alike[:1], CastPlaces(np.array([np.nan]), nowhere[:1], nowhere[:1]))
    before = placed(pings, frame, alone)
    after = placed(pings, frame, Casts(alike, CastPlaces(np.array(cast_s), nowhere, nowhere)))
    assert before.depth_m.tobytes() == after.depth_m.tobytes()
    assert before.east_m.tobytes() == after.east_m.tobytes()


def test_the_outer_beams_depth_differs_as_slow_integration_says() -> None:
    angle = math.radians(60.0)
    time_s = 28.0 / math.cos(angle) / ASSUMED_MPS
    downs = [in_small_steps(list(speeds), 2.0, angle, time_s)[1] for speeds in SPEEDS[:2]]
    found = depth_difference_m(PROFILES[0], PROFILES[1], 2.0, 30.0, angle)
    assert found == pytest.approx(abs(downs[0] - downs[1]), abs=1e-4)
    assert depth_difference_m(PROFILES[0], PROFILES[0], 2.0, 30.0, angle) == 0.0
    assert depth_difference_m(PROFILES[0], PROFILES[1], 30.0, 20.0, angle) == 0.0
