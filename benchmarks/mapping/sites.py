"""How often an unchanged floor is called changed, and how well a change is found, on many generated floors.

    python -m benchmarks.mapping.sites [--seeds 0 1 2 3] [--spacing 4] [--noise 0.05] [--families NAME ...] [--write]

Two surveys of the same floor of 100 x 100 m by single beams along lines, one sounding a metre: the second one's lines
lie elsewhere and run across the first one's. Each is mapped as a mission maps its own soundings (``MapBuilder``), and
the two are compared as those of a site are. Between the surveys nothing changes, or a pit of 20 x 20 m is dredged and
a flat heap of 12 m across is left. ``false`` is the share of compared cells that are called changed at 95 % where
nothing was; ``found`` the share of the changed cells that are, with the right sign; ``volume`` how far the net volume
is off, in its own standard deviations (RMS: 1 where they are right, less where they are wide).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.progress import track

from app.arrays import FloatArray
from app.mapping.gaussian_process.gp import warm_up
from app.mapping.sites import Survey, compare, survey_of
from app.missions.maps.builder import MapBuilder
from benchmarks.common.report import SITES, make_parser, write_section
from simulator.floors.seafloors import FAMILIES, generate
from simulator.floors.terrain import Terrain

SIDE_M = 100.0
PIT_M = (30.0, 50.0)
"""West and east, south and north end of the pit."""
HEAP_AT_M, HEAP_RADIUS_M = (72.0, 70.0), 6.0
STEP_M = 1.0
DEEPENED_M = (0.25, 0.5, 1.0)


@dataclass(frozen=True)
class Compared:
    """What comparing two surveys of one floor gave."""

    false_pct: float
    found_pct: float
    volume_off_sd: float
    volume_off_m3: float


def moved_m(east: FloatArray, north: FloatArray, by_m: float) -> FloatArray:
    """Return by how much the floor was deepened at places: a pit, and a heap of half its height."""
    pit = (np.minimum(east, north) >= PIT_M[0]) & (np.maximum(east, north) < PIT_M[1])
    heap = np.hypot(east - HEAP_AT_M[0], north - HEAP_AT_M[1]) < HEAP_RADIUS_M
    return np.where(pit, by_m, np.where(heap, -0.5 * by_m, 0.0))


def lines(spacing_m: float, offset_m: float, *, across: bool) -> tuple[FloatArray, FloatArray]:
    """Return where is sounded along parallel lines."""
    along, aside = np.meshgrid(np.arange(0.5, SIDE_M, STEP_M), np.arange(offset_m, SIDE_M, spacing_m))
    pair = along.ravel(), aside.ravel()
    return (pair[1], pair[0]) if across else pair


def surveyed(
    terrain: Terrain, at: tuple[FloatArray, FloatArray], by_m: float, noise_m: float, rng: np.random.Generator
) -> Survey:
    """Return what a survey at places finds."""
    depth = terrain.depth_at(*at) + moved_m(*at, by_m) + noise_m * rng.standard_normal(len(at[0]))
    builder = MapBuilder(SIDE_M * np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float), 1.0, 0.25)
    builder.add(np.column_stack([*at, depth, np.full(len(depth), noise_m)]))
    builder.build(thorough=True)
    own = builder.own_map()
    if own is None:
        raise RuntimeError("there is no map of soundings")
    return survey_of(own, 0.0, 0.0)


def compared(terrain: Terrain, seed: int, spacing_m: float, noise_m: float) -> dict[float, Compared]:
    """Return what is found of each change, and of none, by its depth."""
    rng = np.random.default_rng([seed, 29])
    earlier = surveyed(terrain, lines(spacing_m, spacing_m * rng.uniform(), across=False), 0.0, noise_m, rng)
    at = lines(spacing_m, spacing_m * rng.uniform(), across=True)
    grid = earlier.grid
    north, east = np.meshgrid(grid.north_m, grid.east_m, indexing="ij")
    found = {}
    for by_m in (0.0, *DEEPENED_M):
        change = compare(earlier, surveyed(terrain, at, by_m, noise_m, rng))
        moved = moved_m(east, north, by_m)
        same, there = change.compared & (moved == 0.0), change.compared & (moved != 0.0)
        right = change.significant & (np.sign(change.difference_m) == np.sign(moved))
        off_m3 = change.net.m3 + grid.cell_m**2 * float(moved[change.compared].sum())
        found[by_m] = Compared(
            100.0 * float(change.significant[same].mean()),
            100.0 * float(right[there].mean()) if there.any() else np.nan,
            off_m3 / change.net.sd_m3,
            off_m3,
        )
    return found


def row(runs: Sequence[Compared], *, changed: bool) -> str:
    """Return what is shown of several runs."""
    false = np.array([run.false_pct for run in runs])
    off = float(np.sqrt(np.mean([run.volume_off_sd**2 for run in runs])))
    text = f"false {false.mean():.1f} % (worst {false.max():.1f}), volume {off:.2f} sd"
    if changed:
        share = np.array([run.found_pct for run in runs])
        text += f", found {share.mean():.0f} % (worst {share.min():.0f})"
    return text


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study and print it."""
    parser = make_parser(__doc__, SITES, seeds=(0, 1, 2, 3))
    parser.add_argument("--families", nargs="+", choices=sorted(FAMILIES), default=sorted(FAMILIES))
    parser.add_argument("--spacing", type=float, default=4.0, help="metres between lines")
    parser.add_argument("--noise", type=float, default=0.05, help="standard deviation of a sounding, metres")
    options = parser.parse_args(arguments)
    warm_up()
    jobs = [(family, seed) for family in options.families for seed in options.seeds]
    runs: dict[str, list[dict[float, Compared]]] = {}
    for family, seed in track(jobs):
        floor = generate(family, 29_000 + seed, width_m=SIDE_M, height_m=SIDE_M)
        runs.setdefault(family, []).append(compared(floor, seed, options.spacing, options.noise))
    everything = [run for found in runs.values() for run in found]
    rows = {
        f"{name}, {'unchanged' if by_m == 0.0 else f'{by_m:g} m'}": row([run[by_m] for run in found], changed=by_m > 0)
        for name, found in (*runs.items(), ("all", everything))
        for by_m in (0.0, *DEEPENED_M)
    }
    for name, text in rows.items():
        print(f"{name}: {text}")
    title = f"Lines {options.spacing:g} m apart, soundings to {options.noise:g} m"
    write_section(options.write, SITES, title, rows, seeds=options.seeds)


if __name__ == "__main__":
    main()
