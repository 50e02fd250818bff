"""What missions claim to know on the way, beside what their end and the true sea floor make of it.

    python -m benchmarks.mapping.claims [--terrains FOLDER] [--only NAME ...] [--planners cao lawnmower] [--seeds 0]
                                [--write]

Missions are flown without a network, by their own planner, decisions and maps, over the sea floors of 100 x 100 m that
`benchmarks.mapping.maps` uses, and over generated ones of 1 km². At 1, 2, 5, 10, 20 and 50 % of the steps stand: the
coverage that is claimed; the coverage of the same soundings under the model that was learned of all of them
(`MapBuilder.as_of`); the part of the claimed cells whose depth is right, within two of the asked accuracy; mean
deviation and true error.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.gaussian_process.gp import warm_up
from app.missions.forecast.request import starts_of
from app.missions.forecast.simulate import fly
from app.missions.maps.builder import MapBuilder
from app.missions.spec.mission import MissionSpec
from app.missions.team import Team
from benchmarks.common.report import Page, facts, make_parser, put_page
from benchmarks.mapping.terrains import terrains
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from tests.support.paths import TERRAINS

PARTS = (1, 2, 5, 10, 20, 50)
MAPS_AT = (1, 2, 3, 5, 7, 10, 15, 20, 30, 40, 50, 65, 80, 100)
"""Percent of the steps after which a map is made; the model is learned beside the flight, so the next map is the first
to use it."""

LARGE = (("canyon", 3), ("harbour", 4), ("reef", 5), ("rugged", 6), ("smooth", 7))
RIGHT_WITHIN = 2.0
"""A claimed depth is right when it is within so many of the asked accuracies: 95 % should be."""

LAT, LON = 41.185, -8.705


@dataclass(frozen=True)
class Survey:
    """A mission to fly: vehicles, steps and their length, cells of the map, the way between soundings, in metres."""

    vehicles: int
    steps: int
    max_step_m: float
    cell_m: float
    spacing_m: float


SMALL = Survey(2, 100, 10.0, 1.0, 0.5)
WIDE = Survey(3, 160, 25.0, 10.0, 2.0)


@dataclass(frozen=True)
class Claim:
    """What was claimed after ``part`` percent of a mission, and what is to be said of it; see the module."""

    part: int
    claimed_pct: float
    confirmed_pct: float
    right_pct: float
    mean_sd_m: float
    rmse_m: float


@dataclass(frozen=True)
class Claims:
    """Of one mission. ``fall_pct``: how far its coverage ever fell below what it had been."""

    floor: str
    planner: str
    claims: list[Claim]
    fall_pct: float


def spec_of(terrain: Terrain, survey: Survey, planner: str, seed: int, accuracy_m: float) -> MissionSpec:
    """Return a mission over the whole of a terrain."""
    frame = LocalFrame(LAT, LON)
    w, h = terrain.width_m, terrain.height_m
    ring = [[float(x) for x in frame.to_geographic(e, n)][::-1] for e, n in ((0, 0), (w, 0), (w, h), (0, h), (0, 0))]
    return MissionSpec.model_validate(
        {
            "name": "Claims",
            "area": {"type": "Polygon", "coordinates": [ring]},
            "vehicles": [{"name": f"auv-{k + 1}", "kind": "sim"} for k in range(survey.vehicles)],
            "steps": survey.steps,
            "cell_m": survey.cell_m,
            "limits": {"max_step_m": survey.max_step_m},
            "planner": {"name": planner},
            "accuracy_m": accuracy_m,
            "seed": seed,
        }
    )


def claims_of(terrain: Terrain, survey: Survey, planner: str, seed: int = 0, accuracy_m: float = 0.25) -> Claims:
    """Fly a mission and record what it claims."""
    spec = spec_of(terrain, survey, planner, seed, accuracy_m)
    team = Team()
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    starts, _ = starts_of(spec, members)
    builder = MapBuilder(spec.local_area(), spec.cell_m, spec.accuracy_m)
    centres = builder.grid.centres_m
    truth = terrain.depth_at(centres[:, 0], centres[:, 1]).reshape(builder.mask.shape)
    due = {max(1, round(part * survey.steps / 100)): part for part in MAPS_AT}
    coverage, noted = [], []
    for flown in fly(spec, members, starts, builder, terrain, spacing_m=survey.spacing_m):
        part = due.pop(flown.step, None)
        if part is None:
            continue
        built = builder.build()
        if built is None:
            continue
        coverage.append(builder.coverage_pct())
        if part in PARTS:
            noted.append((part, coverage[-1], built, builder.soundings))
        builder.learn()
    builder.build(thorough=True)
    found = []
    for part, claimed, built, soundings in noted:
        known, error = built.map.known(accuracy_m), np.abs(built.map.depth_m - truth)
        seen = builder.mask & np.isfinite(error)
        right = error[known & seen] <= RIGHT_WITHIN * accuracy_m
        end = builder.as_of(soundings, builder.swath).known(accuracy_m)
        found.append(
            Claim(
                part,
                claimed,
                100.0 * float(end[builder.mask].mean()),
                100.0 * float(right.mean()) if len(right) else np.nan,
                built.mean_sd_m,
                float(np.sqrt(np.mean(error[seen] ** 2))),
            )
        )
    fall = float(np.max(np.maximum.accumulate(coverage) - coverage))
    return Claims(terrain.name, planner, found, fall)


def floors(folder: Path, only: list[str]) -> Iterator[tuple[Terrain, Survey]]:
    """Return the sea floors with how they are surveyed."""
    for name, z in terrains(folder, only):
        yield Terrain(z, 1.0, name=name), SMALL
    for family, seed in LARGE:
        name = f"{family} 1 km² (seed {seed})"
        if not only or name in only:
            wide = generate(family, seed, width_m=1000.0, height_m=1000.0, cell_m=5.0)
            yield Terrain(wide.z_m, wide.cell_m, name=name), WIDE


def row(claims: Claims) -> str:
    """Return one line of the table."""
    cells = [
        f"{c.claimed_pct:.1f} / {c.confirmed_pct:.1f}, {'–' if np.isnan(c.right_pct) else f'{c.right_pct:.0f}'}, "
        f"{c.mean_sd_m:.2f} / {c.rmse_m:.2f}"
        for c in claims.claims
    ]
    return " | ".join([f"| {claims.floor}", claims.planner, *cells, f"{claims.fall_pct:.1f} |"])


def summary(found: list[Claims]) -> list[str]:
    """Return the worst of all at each time."""
    lines = ["| | " + " | ".join(f"{part} %" for part in PARTS) + " |", "| --- " * (len(PARTS) + 1) + "|"]
    at = [[c for one in found for c in one.claims if c.part == part] for part in PARTS]
    over = [f"{max(c.claimed_pct - c.confirmed_pct for c in here):+.1f}" for here in at]
    missions = [f"{sum(c.claimed_pct - c.confirmed_pct > 5 for c in here)} of {len(here)}" for here in at]
    # Of very few cells one is a large part.
    right = [[c.right_pct for c in here if c.claimed_pct >= 1] for here in at]
    lines += [
        f"| {words} | " + " | ".join(cells) + " |"
        for words, cells in (
            ("claimed above confirmed at most, points", over),
            ("missions by more than 5 points", missions),
            ("claimed cells that are right, mean, %", [f"{np.mean(x):.1f}" if x else "–" for x in right]),
            ("the same, worst mission that claims 1 % or more", [f"{min(x):.0f}" if x else "–" for x in right]),
            ("mean claimed, %", [f"{np.mean([c.claimed_pct for c in here]):.1f}" for here in at]),
            (
                "mean deviation over true error, median",
                [f"{np.median([c.mean_sd_m / c.rmse_m for c in h]):.2f}" for h in at],
            ),
        )
    ]
    return lines


def main() -> None:
    parser = make_parser(__doc__, Page("claims.md"), seeds=[0])
    parser.add_argument("--terrains", type=Path, default=TERRAINS)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--planners", nargs="*", default=["cao", "lawnmower"])
    parser.add_argument("--accuracy", type=float, default=0.25, help="metres")
    options = parser.parse_args()
    warm_up()
    found = []
    for terrain, survey in floors(options.terrains, options.only):
        for planner in options.planners:
            for seed in options.seeds:
                found.append(claims_of(terrain, survey, planner, seed, options.accuracy))
                print(row(found[-1]), flush=True)
    if not found:
        parser.error(f"no sea floor is called {' or '.join(options.only)}")
    head = "| sea floor | planner | " + " | ".join(f"{part} %" for part in PARTS) + " | fall |"
    lines = [
        "# What missions claim to know",
        "",
        *facts(seeds=options.seeds, hidden={options.terrains: "FOLDER"}),
        f"- accuracy asked: {options.accuracy:g} m",
        "",
        "What the figures mean is in [how the map is made](../maps.md#what-is-known). All missions, by the part flown:",
        "",
        *summary(found),
        "",
        f"Largest fall of the coverage within a mission: {max(one.fall_pct for one in found):.1f} points; more than 2 "
        f"points in {sum(one.fall_pct > 2 for one in found)} of {len(found)} missions.",
        "",
        "Each cell: coverage claimed / confirmed by the end in %, claimed cells that are right in %, mean deviation / "
        "true error in m. Last: how far the coverage ever fell, points.",
        "",
        head,
        "| --- " * (len(PARTS) + 3) + "|",
        *(row(one) for one in found),
    ]
    put_page(options.write, lines)


if __name__ == "__main__":
    main()
