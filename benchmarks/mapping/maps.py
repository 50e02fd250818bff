"""The map's figures in one run: reconstruction, calibration, gross errors, exactness, speed; beside other libraries.

    python -m benchmarks.mapping.maps [--terrains FOLDER] [--only NAME ...] [--seeds 0] [--parts PART ...] [--huge]
                                 [--write]

Other libraries take part where they are installed: `pip install .[benchmarks]`. Seconds are of the processor in the
tables of reconstruction and of the clock in those of speed, where all cores work.
"""

import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from app.arrays import FloatArray
from app.mapping.compare import difference, interval_coverage
from app.mapping.gaussian_process.gp import warm_up
from app.mapping.gross_errors.outliers import flag_outliers
from app.mapping.types import Grid, Soundings
from benchmarks.common.report import Page, facts, make_parser, put_page
from benchmarks.mapping.methods import METHODS, Method, ours
from benchmarks.mapping.speed import exactness, speed
from benchmarks.mapping.terrains import DESIGNS, PATCHY, sound, terrains, with_outliers
from tests.support.paths import TERRAINS

Terrains = list[tuple[str, FloatArray]]
PROBABILITIES = (0.68, 0.95)
WANTED = ((0.60, 0.76), (0.90, 0.98))


def run(method: Method, s: Soundings, grid: Grid, truth: FloatArray) -> list[float]:
    """RMSE in metres, processor seconds, and the parts of cells within the 68 and 95 % intervals."""
    start = time.process_time()
    depth, sd = method(s, grid)
    seconds = time.process_time() - start
    coverage = [np.nan] * 2 if sd is None else [interval_coverage(depth, sd, truth, p) for p in PROBABILITIES]
    return [difference(depth, truth).rmse_m, seconds, *coverage]


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    lines = [" | ".join(head), " | ".join("---" for _ in head), *(" | ".join(row) for row in rows)]
    return [f"| {line} |" for line in lines] + [""]


def reconstruction(floors: Terrains, seeds: Sequence[int]) -> list[str]:
    out = ["## Reconstruction", ""]
    for design in ("random", "lines 4.2 m", "lines 10 m"):
        rows = []
        all_figures = []
        for name, floor in floors:
            figures = np.zeros((len(METHODS), 4))
            for seed in seeds:
                grid, truth, s = sound(floor, design, seed)
                figures += [run(method, s, grid, truth) for method in METHODS.values()]
            figures /= len(seeds)
            all_figures.append(figures)
            rows.append([name, *(f"{x:.4f}" for x in figures[:, 0])])
            print(design, *rows[-1], flush=True)
        mean = np.array(all_figures)
        ratio = mean[:, :, 0] / mean[:, 1:2, 0]
        rows.append(["**geometric mean over stationary**", *(f"{x:.3f}" for x in np.exp(np.log(ratio).mean(axis=0)))])
        rows.append(["**largest over stationary**", *(f"{x:.3f}" for x in ratio.max(axis=0))])
        patchy = [i for i, (name, _) in enumerate(floors) if name in PATCHY]
        if patchy:
            rows.append(["**patchy ones over stationary**", *(f"{x:.3f}" for x in ratio[patchy].mean(axis=0))])
        rows.append(["**seconds**", *(f"{x:.2f}" for x in mean[:, :, 1].mean(axis=0))])
        out += [f"RMSE in metres, {'1000 random soundings' if design == 'random' else design}:", ""]
        out += table(["terrain", *METHODS], rows)
    return out


def calibration(floors: Terrains, seeds: Sequence[int]) -> list[str]:
    rows = []
    figures = np.zeros((len(floors), len(DESIGNS), len(seeds), 2))
    for i, (name, floor) in enumerate(floors):
        for j, design in enumerate(DESIGNS):
            for k, seed in enumerate(seeds):
                grid, truth, s = sound(floor, design, seed)
                figures[i, j, k] = run(ours, s, grid, truth)[2:]
        rows.append([name, *(f"{100 * a:.0f} / {100 * b:.0f}" for a, b in figures[i].mean(axis=1))])
        print("calibration", *rows[-1], flush=True)
    rows.append(["**mean**", *(f"{100 * a:.0f} / {100 * b:.0f}" for a, b in figures.mean(axis=(0, 2)))])
    bands = " / ".join(f"{100 * low:.0f}-{100 * high:.0f}" for low, high in WANTED)
    rows.append([f"**terrains within {bands}**", *_within(figures.mean(axis=2))])
    rows.append([f"**single draws within {bands}**", *_within(np.concatenate(np.moveaxis(figures, 2, 0)))])
    out = [
        "## Calibration",
        "",
        "Percent of the true cells within the 68 and the 95 % interval of the default map:",
        "",
    ]
    return out + table(["terrain", *DESIGNS], rows)


def _within(figures: FloatArray) -> list[str]:
    """Count for each way to sound what is within the wanted bands; ``figures`` is (count, ways, 2)."""
    low, high = np.transpose(WANTED)
    inside = ((figures >= low) & (figures <= high)).sum(axis=0)
    return [f"{a} / {b} of {len(figures)}" for a, b in inside]


def gross_errors(floors: Terrains, seeds: Sequence[int]) -> list[str]:
    rows = []
    for name, floor in floors:
        figures = []
        for seed in seeds:
            grid, truth, s = sound(floor, "random", seed)
            spoiled, wrong = with_outliers(s, seed)
            rejected = flag_outliers(spoiled).rejected
            clean, dirty = (run(ours, x, grid, truth)[0] for x in (s, spoiled))
            figures.append(
                [clean, dirty, dirty / clean, wrong.sum(), (rejected & wrong).sum(), (rejected & ~wrong).sum()]
            )
        a, b, ratio, bad, found, false = np.mean(figures, axis=0)
        rows.append([name, f"{a:.4f}", f"{b:.4f}", f"{ratio:.3f}", f"{bad:.0f}", f"{found:.0f}", f"{false:.1f}"])
        print("gross errors", *rows[-1], flush=True)
    out = ["## Gross errors", "", "1000 random soundings, 2 % of them off by up to half the depth; RMSE in metres:", ""]
    return out + table(
        ["terrain", "without", "with", "ratio", "wrong", "of these rejected", "right ones rejected"], rows
    )


def main() -> None:
    parts = ("reconstruction", "calibration", "outliers", "exactness", "speed")
    parser = make_parser(__doc__, Page("mapping.md"), seeds=[0])
    parser.add_argument("--terrains", type=Path, default=TERRAINS)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--parts", nargs="*", choices=parts, default=parts)
    parser.add_argument("--huge", action="store_true", help="also 5 million soundings onto 4000 x 4000 cells")
    options = parser.parse_args()
    floors = list(terrains(options.terrains, options.only))
    if not floors:
        parser.error(f"no terrain files in {options.terrains}; give the folder with --terrains")
    warm_up()
    lines = ["# The map's figures", ""]
    lines += facts(seeds=options.seeds, hidden={options.terrains: "FOLDER"})
    lines += [f"- compared: {', '.join(METHODS)}", ""]
    for part in options.parts:
        if part == "reconstruction":
            lines += reconstruction(floors, options.seeds)
        elif part == "calibration":
            lines += calibration(floors, options.seeds)
        elif part == "outliers":
            lines += gross_errors(floors, options.seeds)
        elif part == "exactness":
            lines += exactness(floors, table)
        else:
            lines += speed(table, huge=options.huge)
    put_page(options.write, lines)


if __name__ == "__main__":
    main()
