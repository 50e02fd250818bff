"""How well a patch test finds the mounting of a sonar, on generated floors, and what it makes of right ones.

    python -m benchmarks.mapping.patch_test [--seeds 1 3] [--families NAME ...] [--position 0.3] [--level 0.05]

Eight lines over the middle of each floor of 100 x 100 m, by the simulator's multibeam with its errors, but for that of
roll, which is a mounting itself: there and back, once more slowly, and beside these. The vehicle rolls, pitches and
yaws a little; each line lies aside and deeper as a whole, as said, and so do four parts of it by a twentieth of that.
Each floor is flown with a mounting that is drawn (roll, pitch and heading within 3 degrees, latency within 0.4 s) and
not stated, and with a right one. ``off`` is the error of those that were determined, RMS, also in the deviations that
were told with it (RMS 1 where these are right), with the largest.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from rich.progress import track

from app.arrays import FloatArray
from app.mapping.swath.mounting import STRAIGHT, Mounting
from app.mapping.swath.patch_test import PARAMETERS, LineErrors, MountingEstimate, NoOverlapError
from app.mapping.swath.pings import Pings
from benchmarks.common.report import PATCH_TEST, make_parser, write_section
from simulator.floors.seafloors import FAMILIES, generate
from simulator.floors.terrain import Terrain
from simulator.sonars.mounting import SonarMounting
from simulator.sonars.swath import SwathErrors, SwathSonar, SwathSounder
from simulator.vehicles.vehicle import Motion
from tests.support.mapping.patch_lines import FRAME, LONG_M, PATCH, Line, told

SIDE_M = 100.0
CORNER_M = (20.0, 25.0)
"""Of the lines."""
DEPTH_M = 1.0
SONAR = SwathSonar(beams=128, rate_hz=3.0)
ERRORS = replace(SwathErrors(), roll_offset_deg=0.0)
PARTS, OF_PART = 4, 0.05
BETWEEN_S = 60.0
UNITS = {"roll_rad": "degrees", "pitch_rad": "degrees", "heading_rad": "degrees", "latency_s": "s"}


@dataclass(frozen=True)
class Survey:
    """What was found of one mounting."""

    real: Mounting
    found: MountingEstimate | None


def drawn(rng: np.random.Generator) -> Mounting:
    """Return a mounting that nobody knows."""
    roll, pitch, heading = np.radians(rng.uniform(-3.0, 3.0, 3)).tolist()
    return Mounting(roll, pitch, heading, float(rng.uniform(0.0, 0.4)))


def flown(terrain: Terrain, real: Mounting, errors: LineErrors, seed: int) -> Pings:
    """Return the pings of all lines."""
    rng = np.random.default_rng([seed, 31])
    roll_deg, pitch_deg, heading_deg = np.degrees([real.roll_rad, real.pitch_rad, real.heading_rad]).tolist()
    sounder = SwathSounder(SONAR, ERRORS, rng, SonarMounting(roll_deg, pitch_deg, heading_deg))
    parts, start_s = [], 0.0
    for line in PATCH:
        parts.append(_line(terrain, sounder, real.latency_s, line, errors, start_s, rng))
        start_s = float(parts[-1].time_s[-1]) + BETWEEN_S
    return Pings.joined(parts)


def _line(
    terrain: Terrain,
    sounder: SwathSounder,
    latency_s: float,
    line: Line,
    errors: LineErrors,
    start_s: float,
    rng: np.random.Generator,
) -> Pings:
    begin, end, speed_mps = np.array(line[:2]) + CORNER_M, np.array(line[2:4]) + CORNER_M, line[4]
    along = (end - begin) / LONG_M
    time_s = np.arange(0.0, LONG_M / speed_mps, 1.0 / SONAR.rate_hz)
    at = begin + speed_mps * time_s[:, None] * along
    part = np.minimum(PARTS * np.arange(len(time_s)) // len(time_s), PARTS - 1)
    aside = errors.position_m * (rng.standard_normal(2) + OF_PART * rng.standard_normal((PARTS, 2))[part])
    deeper = errors.level_m * (rng.standard_normal() + OF_PART * rng.standard_normal(PARTS)[part])
    roll, pitch = (0.02 * np.sin(rate * time_s + rng.uniform(0.0, 6.0)) for rate in (1.3, 0.9))
    heading = math.atan2(along[0], along[1]) + 0.02 * np.sin(0.5 * time_s)
    ranges = np.array(
        [
            sounder.ping(terrain, Motion(east, north, DEPTH_M, yaw, up, over))
            for (east, north), yaw, up, over in zip(at.tolist(), heading, pitch, roll, strict=True)
        ]
    )
    lat, lon = FRAME.to_geographic(*(at - speed_mps * latency_s * along + aside).T)
    return Pings(
        time_s=start_s + time_s,
        lat_deg=np.asarray(lat),
        lon_deg=np.asarray(lon),
        depth_m=DEPTH_M + deeper,
        roll_rad=roll,
        pitch_rad=pitch,
        heading_rad=heading,
        position_sd_m=np.full(len(time_s), np.nan),
        angle_rad=np.tile(sounder.angles_rad, (len(time_s), 1)).astype(np.float32),
        range_m=ranges.astype(np.float32),
    )


def evaluated(terrain: Terrain, real: Mounting, errors: LineErrors, seed: int) -> Survey:
    """Return what the lines tell where nothing is stated."""
    try:
        return Survey(real, told(flown(terrain, real, errors, seed), STRAIGHT, errors))
    except NoOverlapError:
        return Survey(real, None)


def _off(surveys: Sequence[Survey], name: str) -> FloatArray:
    """Return error and deviation (n, 2) where a parameter was determined."""
    estimates = [(one.real, one.found.parameters[name]) for one in surveys if one.found is not None]
    pairs = [
        (one.value - getattr(real, name), one.sd)
        for real, one in estimates
        if one.value is not None and one.sd is not None
    ]
    return np.array(pairs).reshape(-1, 2)


def rows_of(wrong: Sequence[Survey], right: Sequence[Survey]) -> dict[str, str]:
    """Return what is shown of surveys with drawn and with right mountings."""
    rows = {}
    for label, surveys in (("drawn", wrong), ("right", right)):
        for name in PARAMETERS:
            off = _off(surveys, name)
            text = f"determined {len(off)} of {len(surveys)}"
            if len(off):
                scale = 1.0 if name == "latency_s" else math.degrees(1.0)
                beside = off[:, 0] / off[:, 1]
                rms, told_rms = np.sqrt((off[:, 0] ** 2).mean()), np.sqrt((beside**2).mean())
                text += f", off {scale * rms:.3f} {UNITS[name]}, {told_rms:.2f} deviations"
                text += f" (largest {abs(beside).max():.1f})"
            rows[f"{label}: {name.rpartition('_')[0]}"] = text
        found = [one.found for one in surveys if one.found is not None]
        proposed = [one for one in found if one.proposal is not None]
        text = f"{len(proposed)} of {len(surveys)}"
        if proposed:
            before, after = (
                np.mean([getattr(one.agreement, end) for one in proposed]) for end in ("before_m", "after_m")
            )
            text += f", lines differ by {before:.3f} m RMS before, {after:.3f} m after on average"
        rows[f"{label}: a mounting is proposed"] = text
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study and print it."""
    parser = make_parser(__doc__, PATCH_TEST, seeds=(1, 3))
    parser.add_argument("--families", nargs="+", choices=sorted(FAMILIES), default=sorted(FAMILIES))
    parser.add_argument("--position", type=float, default=0.3, help="how far lines lie aside, metres")
    parser.add_argument("--level", type=float, default=0.05, help="how much deeper lines lie, metres")
    options = parser.parse_args(arguments)
    errors = LineErrors(options.position, options.level)
    wrong, right = [], []
    for family, seed in track([(family, seed) for family in options.families for seed in options.seeds]):
        floor = generate(family, 31_000 + seed, width_m=SIDE_M, height_m=SIDE_M)
        wrong.append(evaluated(floor, drawn(np.random.default_rng([seed, 37])), errors, seed))
        right.append(evaluated(floor, STRAIGHT, errors, seed))
    rows = rows_of(wrong, right)
    for name, text in rows.items():
        print(f"{name}: {text}")
    title = f"Lines {options.position:g} m aside, {options.level:g} m deeper"
    write_section(options.write, PATCH_TEST, title, rows, seeds=options.seeds)


if __name__ == "__main__":
    main()
