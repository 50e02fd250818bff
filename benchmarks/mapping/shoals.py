"""Whether the layer `shoal_pct` keeps its word, and whether maps stay plausible far from their soundings.

    python -m benchmarks.mapping.shoals [--terrains FOLDER] [--floors NAME ...] [--seeds 11 12 13] [--write]

Reliability: generated floors of 100 x 100 m with a depth every 0.5 m are sounded on lines, all over or by swaths, and
mapped on cells of 2 m. Every cell is asked for the chance that its shallowest place is above a depth, which is such
that it is true of 1, 5, 20 and 50 % of the floor's cells. Cells are told apart by what was told of them: beside the
mean chance stands how often it was true, and what a normal distribution of the same scale says of these cells.

Bounds: single tracks and lines over part of a floor, as at a survey's start, on the generated floors and, from a folder
of terrain files, on `large_leixoes_west_1m`. Told are the depths that were sounded, those of the map as it is and as
the process alone has it (`calibrate=False`), and both errors.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.stats import norm

from app.arrays import BoolArray, FloatArray
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.shoals import deviations_above, shoal_chance
from app.mapping.swath.density import DensityGrid
from app.mapping.swath.gridded import gridded_map, without_guesses
from app.mapping.types import BathymetricMap, Grid, Soundings
from benchmarks.common.report import Page, facts, make_parser, put_page
from simulator.floors.seafloors import generate
from tests.support.paths import TERRAINS

FLOORS = ("boulders", "reef", "reef_field", "harbour", "rugged", "ridge", "canyon", "smooth")
LINES = {"lines 5 m": 5.0, "lines 10 m": 10.0, "lines 20 m": 20.0, "all over": 2.0}
SWATHS = "swaths"
SIDE_M, FINE_M, CELL_M = 100.0, 0.5, 2.0
SHOAL_SHARES = (0.01, 0.05, 0.2, 0.5)
EDGES = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 0.6, 0.9, 1.0)
SWATH_SOUNDINGS = 12
"""In each cell, on average, where swaths were swept."""


def floor(name: str, seed: int) -> FloatArray:
    """Return depths every :data:`FINE_M`, row 0 south; ``boulders``: rocks of 0.5 to 2.5 m on a gentle slope."""
    if name != "boulders":
        z = np.asarray(generate(name, seed, width_m=SIDE_M, height_m=SIDE_M, cell_m=FINE_M).z_m)
        return z[: round(SIDE_M / FINE_M), : round(SIDE_M / FINE_M)]
    rng = np.random.default_rng(seed)
    at = (np.arange(round(SIDE_M / FINE_M)) + 0.5) * FINE_M
    east, north = np.meshgrid(at, at)
    z = 9.0 + 0.02 * east + 0.2 * np.sin(north / 11.0)
    for e, n, radius in zip(*rng.uniform(0.0, SIDE_M, (2, 60)), rng.uniform(0.7, 3.0, 60), strict=True):
        dome = np.clip(1.0 - ((east - e) ** 2 + (north - n) ** 2) / radius**2, 0.0, None)
        z = z - rng.uniform(0.5, 2.5) * np.sqrt(dome)
    return np.asarray(z)


def sounded(z: FloatArray, cell_m: float, east: FloatArray, north: FloatArray, seed: int) -> Soundings:
    """Return soundings at places of a floor, with noise of 1 % of the range to a vehicle 2.5 m deep."""
    depth = map_coordinates(z, [north / cell_m - 0.5, east / cell_m - 0.5], order=1, mode="nearest")
    sd = 0.01 * np.maximum(depth - 2.5, 1.0)
    return Soundings(east, north, depth + sd * np.random.default_rng(seed).standard_normal(len(depth)), sd)


def mapped(z: FloatArray, design: str, seed: int) -> BathymetricMap:
    """Return the map of a floor that was sounded in one of the ways."""
    side = round(SIDE_M / CELL_M)
    grid = Grid(0.0, 0.0, CELL_M, side, side)
    if design != SWATHS:
        gap = LINES[design]
        places = np.meshgrid(np.arange(gap / 2.0, SIDE_M, gap), np.arange(0.5, SIDE_M, 1.0))
        east, north = (one.ravel() for one in places)
        return GaussianProcessMap().fit(sounded(z, FINE_M, east, north, seed)).predict(grid)
    east, north = np.random.default_rng(seed).uniform(0.0, SIDE_M, (2, SWATH_SOUNDINGS * side**2))
    density = DensityGrid(grid, np.ones((side, side), dtype=bool))
    soundings = sounded(z, FINE_M, east, north, seed)
    density.add(east, north, soundings.depth_m, soundings.sd_m)
    made = gridded_map(density)
    if made is None:
        raise ValueError("the swaths met no cell")
    return without_guesses(made)


@dataclass(frozen=True)
class Answers:
    """Chances that were told of cells, and whether they came true, (n,) each; ``normal``: by a normal one."""

    floor: str
    design: str
    chance: FloatArray
    normal: FloatArray
    true: BoolArray


def answers(name: str, design: str, seed: int) -> Answers:
    """Map a floor, and ask all supported cells."""
    z = floor(name, seed)
    made = mapped(z, design, seed)
    times = round(CELL_M / FINE_M)
    shallowest = z.reshape(made.grid.rows, times, made.grid.cols, times).min(axis=(1, 3))
    chance, normal, true = [], [], []
    for share in SHOAL_SHARES:
        depth_m = float(np.quantile(shallowest, share))
        told = shoal_chance(made, depth_m)
        known = np.isfinite(told)
        normal.append(norm.sf(deviations_above(made, depth_m))[known])
        chance.append(told[known])
        true.append(shallowest[known] < depth_m)
    return Answers(name, design, np.concatenate(chance), np.concatenate(normal), np.concatenate(true))


def reliability(found: list[Answers]) -> list[str]:
    """Return the table of what was told beside how often it came true."""
    chance, true = np.concatenate([a.chance for a in found]), np.concatenate([a.true for a in found])
    normal = np.concatenate([a.normal for a in found])
    lines = ["| told, % | cells | mean told, % | came true, % | a normal distribution, % |", "| --- " * 5 + "|"]
    for low, high in pairwise(EDGES):
        here = (chance >= low) & ((chance < high) | (high == 1.0))
        if here.any():
            lines.append(
                f"| {100 * low:g} to {100 * high:g} | {here.sum()} | {100 * chance[here].mean():.3f} | "
                f"{100 * true[here].mean():.3f} | {100 * normal[here].mean():.4f} |"
            )
    return lines


def by_survey(found: list[Answers]) -> list[str]:
    """Return, for each floor and way to sound, shoal cells of those told less than 1 %, beside what was told."""
    designs = list(dict.fromkeys(a.design for a in found))
    lines = ["| floor | " + " | ".join(designs) + " |", "| --- " * (len(designs) + 1) + "|"]
    for name in dict.fromkeys(a.floor for a in found):
        cells = []
        for design in designs:
            these = [a for a in found if (a.floor, a.design) == (name, design)]
            chance, true = np.concatenate([a.chance for a in these]), np.concatenate([a.true for a in these])
            low = chance < 0.01
            cells.append(f"{100 * chance[low].mean():.3f} / {100 * true[low].mean():.3f}" if low.any() else "–")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def starts(folder: Path, names: list[str], seeds: list[int]) -> Iterator[tuple[str, FloatArray, float, Soundings]]:
    """Return surveys that have just begun: what they are, the floor, its cell, and what was sounded."""
    for name in names:
        for seed in seeds:
            z = floor(name, seed)
            east, north = (x.ravel() for x in np.meshgrid(np.arange(5.0, SIDE_M, 10.0), np.arange(0.5, 30.0)))
            yield f"{name} (seed {seed}), first 30 % of lines", z, FINE_M, sounded(z, FINE_M, east, north, seed)
    path = folder / "large_leixoes_west_1m.npz"
    if not path.exists():
        return
    with np.load(path) as file:
        z = np.asarray(file["z"], float)
    z = np.where(np.isfinite(z), z, np.nanmean(z))
    for west_m in (60.0, 250.0, 430.0):
        along = np.arange(60.0)
        yield f"Leixões, 60 m at {west_m:g} m", z, 1.0, sounded(z, 1.0, np.full(60, west_m), 100.0 + along, 0)
        along = np.arange(200.0)
        east = np.concatenate([np.full(200, west_m), np.full(200, west_m + 15.0)])
        north = np.tile(100.0 + along, 2)
        yield f"Leixões, two lines of 200 m at {west_m:g} m", z, 1.0, sounded(z, 1.0, east, north, 0)
        along = np.arange(150.0)
        east = np.clip(west_m + 0.3 * along + 10.0 * np.sin((300.0 + along) / 20.0), 1.0, 490.0)
        yield f"Leixões, a winding track at {west_m:g} m", z, 1.0, sounded(z, 1.0, east, 300.0 + along, 0)


def bounds(name: str, z: FloatArray, fine_m: float, soundings: Soundings) -> str:
    """Return the row of one survey that has just begun."""
    times = 4 if fine_m < 1.0 else 5
    rows, cols = (n // times for n in z.shape)
    truth = z[: rows * times, : cols * times].reshape(rows, times, cols, times).mean(axis=(1, 3))
    grid = Grid(0.0, 0.0, fine_m * times, rows, cols)
    bounded = GaussianProcessMap().fit(soundings).predict(grid)
    alone = GaussianProcessMap(calibrate=False).fit(soundings).predict(grid).depth_m
    rmse = [float(np.sqrt(np.mean((depth - truth) ** 2))) for depth in (alone, bounded.depth_m)]
    spans = [f"{depth.min():.1f} to {depth.max():.1f}" for depth in (truth, soundings.depth_m, alone, bounded.depth_m)]
    above = 100.0 * np.mean(alone < 0.0), 100.0 * np.mean(bounded.depth_m < 0.0)
    return (
        f"| {name} | {' | '.join(spans)} | {above[0]:.0f} → {above[1]:.0f} | {rmse[0]:.2f} → {rmse[1]:.2f} | "
        f"{float(np.sqrt(np.mean(bounded.sd_m**2))):.2f} |"
    )


def main() -> None:
    parser = make_parser(__doc__, Page("shoals.md"), seeds=[11, 12, 13])
    parser.add_argument("--terrains", type=Path, default=TERRAINS)
    parser.add_argument("--floors", nargs="+", choices=FLOORS, default=list(FLOORS))
    options = parser.parse_args()
    designs = (*LINES, SWATHS)
    found = [answers(name, design, seed) for name in options.floors for design in designs for seed in options.seeds]
    swept = [a for a in found if a.design == SWATHS]
    lines = ["# Shoal water between lines, and plausible depths", ""]
    lines += [*facts(seeds=options.seeds, hidden={options.terrains: "FOLDER"}), ""]
    lines += ["What is measured stands at the head of `benchmarks/mapping/shoals.py`.", ""]
    lines += ["## Reliability of the chance of shoal water", "", "Lines and soundings all over:", ""]
    lines += [*reliability([a for a in found if a.design != SWATHS]), "", "Swaths:", "", *reliability(swept), ""]
    lines += ["Of cells that were told less than 1 %, by survey, mean told / came true, %:", "", *by_survey(found), ""]
    lines += ["## Depths far from soundings", ""]
    lines += [
        "Metres; first the process alone, then (→) the map. Last: the map's deviation, root mean square.",
        "",
    ]
    lines += ["| survey | true | sounded | process | map | cells above datum, % | RMSE | deviation |"]
    lines += ["| --- " * 8 + "|"]
    lines += [bounds(*start) for start in starts(options.terrains, options.floors, options.seeds[:1])]
    put_page(options.write, lines)


if __name__ == "__main__":
    main()
