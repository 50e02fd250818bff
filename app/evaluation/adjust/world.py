"""Surveys by vehicles that drift: lines and crosslines over a known sea floor, and where they took themselves to be."""

from dataclasses import dataclass, replace

import numpy as np

from app.arrays import FloatArray, IntArray
from app.estimation.adjustment import Fixes, TrackSoundings
from app.evaluation.coverage.world import sounded
from simulator.floors.terrain import Terrain

SPEED_MPS = 1.2
ALTITUDE_M = 3.0
LEAST_DEPTH_M = 0.2
TURN_S = 10.0
RATE_HZ = 2.0
APERTURE_RAD = float(np.radians(120.0))
BEAMS = 64
OVERLAP = 0.4
"""Share of a swath that the next line sees again."""
SINGLE_SPACING_M = 5.0
CROSSLINES = 3
LARGEST_M = 250.0

ROLL_SD_RAD = float(np.radians(0.1))
RANGE_SD, RANGE_SD_PCT = 0.03, 0.5
DRAUGHT_SD_M = 0.03
HEADING_SD_RAD = float(np.radians(0.5))
FIX_SD_M = 0.3

WALK_SHARE = 0.2
"""Part of the drift's variance at the end of a dive that is a random walk; the rest has a rate that changes slowly."""
RATE_TIMES_S = (200.0, 1200.0)
STEP_S = 1.0


@dataclass(frozen=True)
class DriftScenario:
    """A survey by vehicles that drift.

    Attributes
    ----------
    terrain
    drift_m
        RMS of the horizontal error that a vehicle has gathered when its dive ends, but for what its heading adds.
    vehicles
    swath
        Whether they have swath sonars; else single beams.
    seed
    largest_m
        Of larger sea floors a square of this side is surveyed, about their middle.
    """

    terrain: Terrain
    drift_m: float
    vehicles: int = 2
    swath: bool = True
    seed: int = 0
    largest_m: float = LARGEST_M

    @property
    def spacing_m(self) -> float:
        """Between lines."""
        return (
            2.0 * ALTITUDE_M * float(np.tan(0.5 * APERTURE_RAD)) * (1.0 - OVERLAP) if self.swath else SINGLE_SPACING_M
        )

    @property
    def rectangle_m(self) -> tuple[float, float, float, float]:
        """West, south, east and north of what is surveyed."""
        terrain = self.terrain
        wide, high = min(terrain.width_m, self.largest_m), min(terrain.height_m, self.largest_m)
        west, south = 0.5 * (terrain.width_m - wide), 0.5 * (terrain.height_m - high)
        return west, south, west + wide, south + high


@dataclass(frozen=True)
class DriftingSurvey:
    """What came of it.

    Attributes
    ----------
    soundings
        By the vehicles' own positions, some millions at most.
    fixes
        At the begin and at the end of each dive.
    vehicle, time_s : (n,), error_m : (n, 2)
        Of each second under way: reckoned position minus true one.
    minutes
        Of the longest dive.
    """

    soundings: TrackSoundings
    fixes: Fixes
    vehicle: IntArray
    time_s: FloatArray
    error_m: FloatArray
    minutes: float


def fly(scenario: DriftScenario) -> DriftingSurvey:
    """Fly it: vehicles hold their lines by their own positions, so they are beside them in truth."""
    rng = np.random.default_rng([scenario.seed, 1])
    parts, errors, vehicles, times = [], [], [], []
    fixes: list[tuple[int, float, float, float]] = []
    longest_s = 0.0
    for number, legs in enumerate(_plans(scenario)):
        time_s, place, heading, on_line = _way(legs)
        error = _drift(scenario, time_s, place, rng)
        longest_s = max(longest_s, float(time_s[-1]))
        start_off, end_off = rng.normal(0.0, FIX_SD_M, (2, 2))
        # It begins by a fix, with its error.
        error = error + start_off
        fixes.append((number, 0.0, 0.0, 0.0))
        fixes.append((number, float(time_s[-1]), *(error[-1] + end_off).tolist()))
        found = _soundings(scenario, number, time_s[on_line], place[on_line], heading[on_line], error[on_line], rng)
        parts.append(found)
        whole = np.arange(0, len(time_s), max(1, round(RATE_HZ)))
        errors.append(error[whole])
        vehicles.append(np.full(len(whole), number))
        times.append(time_s[whole])
    at = np.array(fixes)
    return DriftingSurvey(
        soundings=TrackSoundings.joined(parts),
        fixes=Fixes(
            vehicle=at[:, 0].astype(np.int64),
            time_s=at[:, 1],
            east_m=at[:, 2],
            north_m=at[:, 3],
            sd_m=np.full(len(at), FIX_SD_M),
            resets=np.ones(len(at), dtype=bool),
        ),
        vehicle=np.concatenate(vehicles),
        time_s=np.concatenate(times),
        error_m=np.concatenate(errors),
        minutes=longest_s / 60.0,
    )


def _plans(scenario: DriftScenario) -> list[FloatArray]:
    """Return the ends of each vehicle's lines, (k, 2, 2): its share of the lines side by side, then of crosslines."""
    west, south, east, north = scenario.rectangle_m
    margin = 0.25 * scenario.spacing_m
    upright = north - south > east - west
    low, high = (west, east) if upright else (south, north)
    begin, end = (south, north) if upright else (west, east)
    count = max(scenario.vehicles, int(np.ceil((high - low) / scenario.spacing_m)))
    across = low + (np.arange(count) + 0.5) * (high - low) / count
    plans = []
    crossing = begin + (np.arange(CROSSLINES) + 0.5) * (end - begin) / CROSSLINES
    for number, share in enumerate(np.array_split(across, scenario.vehicles)):
        lines = [[[a, begin + margin], [a, end - margin]] for a in share]
        lines += [[[low + margin, a], [high - margin, a]] for a in crossing[number :: scenario.vehicles]]
        legs = np.array(lines)
        legs[1::2] = legs[1::2, ::-1]
        plans.append(legs if upright else legs[:, :, ::-1])
    return plans


def _way(legs: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return time (n,), place (n, 2), heading (n,) and whether it is on a line (n,) of a vehicle on its legs."""
    times, places, headings, lines = [], [], [], []
    now_s = 0.0
    previous: FloatArray | None = None
    for begin, end in legs:
        if previous is not None:
            between = float(np.hypot(*(begin - previous)))
            span_s = TURN_S + between / SPEED_MPS
            at = np.arange(0.0, span_s, 1.0 / RATE_HZ)
            places.append(previous + (at / span_s)[:, None] * (begin - previous))
            headings.append(np.zeros(len(at)))
            lines.append(np.zeros(len(at), dtype=bool))
            times.append(now_s + at)
            now_s += span_s
        length_m = float(np.hypot(*(end - begin)))
        at = np.arange(0.0, length_m / SPEED_MPS, 1.0 / RATE_HZ)
        places.append(begin + (at * SPEED_MPS / length_m)[:, None] * (end - begin))
        headings.append(np.full(len(at), np.arctan2(*(end - begin))))
        lines.append(np.ones(len(at), dtype=bool))
        times.append(now_s + at)
        now_s += length_m / SPEED_MPS
        previous = end
    return np.concatenate(times), np.concatenate(places), np.concatenate(headings), np.concatenate(lines)


def _drift(scenario: DriftScenario, time_s: FloatArray, place: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the error that a vehicle gathers, (n, 2): a random walk, a rate that changes slowly, a wrong heading."""
    step = np.diff(time_s, prepend=time_s[0])
    whole = float(time_s[-1])
    sd = scenario.drift_m / np.sqrt(2.0)
    walk = np.cumsum(rng.standard_normal((len(time_s), 2)) * np.sqrt(step)[:, None], axis=0) / np.sqrt(whole)
    tau = float(np.exp(rng.uniform(*np.log(RATE_TIMES_S))))
    rate = np.zeros((len(time_s), 2))
    rate[0] = rng.standard_normal(2)
    kept = np.exp(-step / tau)
    noise = rng.standard_normal((len(time_s), 2)) * np.sqrt(1.0 - kept**2)[:, None]
    for k in range(1, len(time_s)):
        rate[k] = kept[k] * rate[k - 1] + noise[k]
    grown = np.cumsum(rate * step[:, None], axis=0)
    grown /= np.sqrt(2.0 * tau * (whole - tau * (1.0 - np.exp(-whole / tau))))
    turned = rng.normal(0.0, HEADING_SD_RAD)
    moved = place - place[0]
    by_heading = turned * np.column_stack([-moved[:, 1], moved[:, 0]])
    return np.asarray(sd * (np.sqrt(WALK_SHARE) * walk + np.sqrt(1.0 - WALK_SHARE) * grown) + by_heading)


def _soundings(
    scenario: DriftScenario,
    number: int,
    time_s: FloatArray,
    place: FloatArray,
    heading: FloatArray,
    error: FloatArray,
    rng: np.random.Generator,
) -> TrackSoundings:
    terrain = scenario.terrain
    true = place - error
    below = terrain.depth_at(true[:, 0], true[:, 1])
    seen = np.isfinite(below) & (below > LEAST_DEPTH_M)
    true, below, time_s, error = true[seen], below[seen], time_s[seen], error[seen]
    heading = heading[seen]
    vehicle_m = np.maximum(below - ALTITUDE_M, 0.0)
    half = np.tan(0.5 * APERTURE_RAD)
    angles = np.arctan(np.linspace(-half, half, BEAMS)) if scenario.swath else np.zeros(1)
    rolls = rng.normal(0.0, ROLL_SD_RAD, len(true)) if scenario.swath else np.zeros(len(true))
    poses = np.column_stack([true, heading])
    starboard, depth = sounded(terrain.z_m, terrain.cell_m, poses, vehicle_m, angles, rolls, 100.0)
    draught = rng.normal(0.0, DRAUGHT_SD_M)
    ping, beam = np.nonzero(np.isfinite(depth))
    altitude = depth[ping, beam] - vehicle_m[ping]
    sd = np.hypot(RANGE_SD, 0.01 * RANGE_SD_PCT * altitude)
    sd = np.hypot(sd, ROLL_SD_RAD * np.abs(starboard[ping, beam]))
    aside = starboard[ping, beam]
    range_error = np.hypot(RANGE_SD, 0.01 * RANGE_SD_PCT * altitude) * rng.standard_normal(len(ping))
    # Roll is known but for its error: places are by the roll as it was measured.
    return TrackSoundings(
        vehicle=np.full(len(ping), number),
        time_s=time_s[ping],
        east_m=true[ping, 0] + error[ping, 0] + aside * np.cos(heading[ping]),
        north_m=true[ping, 1] + error[ping, 1] - aside * np.sin(heading[ping]),
        depth_m=depth[ping, beam] + draught + range_error - rolls[ping] * aside,
        sd_m=sd,
    )


def without_drift(survey: DriftingSurvey, offset_m: FloatArray) -> TrackSoundings:
    """Return the soundings where they are when their positions were off by something, (n, 2)."""
    soundings = survey.soundings
    return replace(soundings, east_m=soundings.east_m - offset_m[:, 0], north_m=soundings.north_m - offset_m[:, 1])
