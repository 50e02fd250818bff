"""ACCESS13's three tables with ours beside them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.evaluation.runs.summary import spread
from app.evaluation.search.run import SearchJob
from app.evaluation.search.world import SearchScenario
from app.exploration.planner.options import PlannerOptions
from simulator.obstacles.car_parks import SCENARIOS, car_park

Run = Mapping[str, Any]

RADII_M = (50.0, 100.0)
WINDOW = 3000.0
TIMES = ("plan_ms_median", "plan_ms_p99", "plan_cpu_ms_median", "plan_cpu_ms_p99")


@dataclass(frozen=True)
class Variant:
    """A planner under one of the clocks."""

    title: str
    planner: str
    clock: str
    robots: int = 1


VARIANTS = {
    "literal": Variant("ACCESS13's method (`cao`), a step counts as a step", "cao", "steps"),
    "default": Variant("default (`rollout`), ways count", "rollout", "way"),
    "team": Variant("default, 3 robots, ways count", "rollout", "way", 3),
    "literal-way": Variant("ACCESS13's method (`cao`), ways count", "cao", "way"),
    "spsa": Variant("`spsa`, a step counts as a step", "spsa", "steps"),
    "random": Variant("`random`, a step counts as a step", "random", "steps"),
}

PUBLISHED = {
    (1, 50.0): ("88.88 / 60.23", "0.14 / 31.02", "65.27 / 39.99"),
    (1, 100.0): ("81.16 / 72.94", "15.69 / 27.85", "38.22 / 39.35"),
    (2, 50.0): ("89.09 / 56.24", "15.29 / 20.78", "59.31 / 28.88"),
    (2, 100.0): ("76.50 / 72.02", "18.11 / 23.79", "34.09 / 29.15"),
    (3, 50.0): ("93.76 / 64.36", "4.22 / 34.41", "stuck"),
    (3, 100.0): ("86.32 / 67.92", "8.35 / 31.56", "stuck"),
}
"""Goal area and map in %, of CAO, random and SPSA (tables I to III)."""


def report_jobs(names: Sequence[str], seeds: Sequence[int]) -> list[SearchJob]:
    """Return the runs of some variants, seed by seed, so that an interrupted report has all rows."""
    return [
        SearchJob(
            SearchScenario(
                car_park(scenario, seed), radius, WINDOW, VARIANTS[name].robots, seed=seed,
                clock="steps" if VARIANTS[name].clock == "steps" else "way",
            ),
            VARIANTS[name].planner,
            PlannerOptions(),
        )
        for seed in seeds
        for name in names
        for scenario in SCENARIOS
        for radius in RADII_M
    ]  # fmt: skip


def search_report(runs: Sequence[Run], facts: Mapping[str, str]) -> str:
    """Return the report in Markdown."""
    lines = ["# Search and rescue: ACCESS13's car parks", ""]
    lines += [f"- {name}: {value}" for name, value in facts.items()]
    lines += [
        "",
        f"150 x 150 m, cells of 1 m, scanner 8 m and 0.5 degrees; window {WINDOW:g} steps of 1 m. Goal area and map"
        " explored, in % of what can be seen from where a robot can go (the paper's fully explored map): means ± half"
        " their 95 % interval over car parks of as many seeds. The paper shows its car parks in figures only and does"
        " not state its window; ours are drawn by their"
        " descriptions. In the paper a step is a step however long the supervisor makes it; *ways count* charges each"
        " leg by its length. *Trapped* is who saw nothing new in the last 200 or more metres or steps of the window in"
        " which it searched, while 5 % or more were left; the longest standstill, in the same, is one that"
        " it got away from or not. Time to decide is that on the clock and, after it, what its thread computed in"
        " it: on a busy machine the first is longer.",
        "",
        "## Published",
        "",
        "| scenario, r_c | CAO | random | SPSA |",
        "|---|---|---|---|",
    ]
    lines += [f"| {k[0]}, {k[1]:g} | {' | '.join(row)} |" for k, row in PUBLISHED.items()]
    there = {name: [run for run in runs if _is_of(run, variant)] for name, variant in VARIANTS.items()}
    for name, mine in there.items():
        if mine:
            lines += ["", f"## {VARIANTS[name].title}", "", *_table(mine)]
    missing = [name for name, mine in there.items() if not mine]
    if missing:
        lines += ["", f"Not run yet (`--only`): {', '.join(missing)}."]
    return "\n".join(lines) + "\n"


def _is_of(run: Run, variant: Variant) -> bool:
    return (run["planner"], run["clock"], run["robots"], run["window_m"]) == (
        variant.planner, variant.clock, variant.robots, WINDOW,
    )  # fmt: skip


def _table(runs: Sequence[Run]) -> list[str]:
    rows = [
        "| scenario, r_c | runs | goal area, % | map, % | back in time | collisions | too close | trapped |"
        " longest standstill | decision, ms (median, 99 %; computed) |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for scenario, radius in PUBLISHED:
        mine = [r for r in runs if (r["scenario"], r["rc"]) == (f"car park {scenario}", radius)]
        if not mine:
            rows.append(f"| {scenario}, {radius:g} | 0 | | | | | | | | |")
            continue
        goal, whole = (spread([r[key] for r in mine]) for key in ("goal_area_pct", "map_pct"))
        times = ", ".join(f"{sum(r[key] for r in mine) / len(mine):.1f}" for key in TIMES)
        rows.append(
            f"| {scenario}, {radius:g} | {len(mine)} |"
            f" {goal.mean:.1f} ± {goal.ci95:.1f} | {whole.mean:.1f} ± {whole.ci95:.1f} |"
            f" {sum(r['returned_in_time'] for r in mine)} | {sum(r['collisions'] for r in mine)} |"
            f" {sum(r['too_close'] for r in mine)} | {sum(r['trapped'] for r in mine)} |"
            f" {max(r['longest_standstill_m'] for r in mine):.0f} | {times} |"
        )
    return rows
