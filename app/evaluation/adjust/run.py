"""One survey before and after its adjustment as a job for :mod:`app.evaluation.runs.jobs`."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.arrays import FloatArray
from app.estimation import Sensor
from app.estimation.adjustment import AdjustedTracks, TrackSoundings, adjusted, thinned
from app.evaluation.adjust.world import DriftingSurvey, DriftScenario, fly, without_drift
from app.evaluation.runs.jobs import Progress
from app.mapping.compare import difference
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.swath.density import DensityGrid
from app.mapping.types import Grid, Soundings

STEPS = 3
CELL_M = 0.5
PERIOD_S = 5.0
MOST_FOR_MAP = 6000
"""A map of single beams is made of so many soundings at most, evenly chosen."""


@dataclass(frozen=True)
class AdjustJob:
    """A survey, its adjustment, and what that did to positions and map."""

    scenario: DriftScenario

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        one = self.scenario
        return f"{one.terrain.name}, {one.vehicles} vehicles, drift {one.drift_m:g} m, seed {one.seed}"

    @property
    def steps(self) -> int:
        """Its length."""
        return STEPS

    @property
    def sensor(self) -> Sensor | None:
        """No planner has to be warmed up."""
        return None

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it. ``…_ratio`` are after over before."""
        scenario = self.scenario
        survey = fly(scenario)
        progress(1)
        begun = time.perf_counter()
        places = thinned(survey.soundings, CELL_M, PERIOD_S)
        found = adjusted(places, survey.fixes, cell_m=CELL_M)
        seconds = time.perf_counter() - begun
        progress(2)
        left = survey.error_m - _offsets(found, survey)
        before_m, after_m = _rms(survey.error_m), _rms(left)
        still = np.zeros((len(survey.soundings), 2))
        adjusted_m = without_drift(survey, _offsets_of(found, survey.soundings))
        map_before, map_after = _map_errors(scenario, without_drift(survey, still), adjusted_m)
        progress(3)
        held = found.held_out
        sd = _offset_sd(found, survey)
        outcomes = [tie.outcome.value for tie in found.ties]
        tied_m = None if held is None else (held.after_m if found.by_ties else held.by_fixes_m)
        return {
            "terrain": scenario.terrain.name,
            "drift_m": scenario.drift_m,
            "vehicles": scenario.vehicles,
            "swath": scenario.swath,
            "seed": scenario.seed,
            "minutes": survey.minutes,
            "position_error_ratio": after_m / before_m,
            "rmse_ratio": map_after / map_before,
            "ties_rms_ratio": None if held is None or tied_m is None else tied_m / held.before_m,
            "position_error_m": [before_m, after_m],
            "rmse_m": [map_before, map_after],
            "ties_rms_m": None if held is None else [held.before_m, held.by_fixes_m, held.after_m],
            "by_ties": found.by_ties,
            "significance": None if held is None else held.significance,
            "within_95_pct": 100.0 * float(np.mean((np.abs(left) <= 1.96 * sd).mean(axis=1))),
            "ties": {outcome: outcomes.count(outcome) for outcome in sorted(set(outcomes))},
            "seconds": seconds,
        }


def _offsets(found: AdjustedTracks, survey: DriftingSurvey) -> FloatArray:
    return np.asarray(found.nodes.interpolation(survey.vehicle, survey.time_s) @ found.offset_m)


def _offset_sd(found: AdjustedTracks, survey: DriftingSurvey) -> FloatArray:
    return np.asarray(found.nodes.interpolation(survey.vehicle, survey.time_s) @ found.sd_m)


def _offsets_of(found: AdjustedTracks, soundings: TrackSoundings) -> FloatArray:
    return np.asarray(found.nodes.interpolation(soundings.vehicle, soundings.time_s) @ found.offset_m)


def _rms(off: FloatArray) -> float:
    return float(np.sqrt(np.mean((off**2).sum(axis=1))))


def _map_errors(scenario: DriftScenario, before: TrackSoundings, after: TrackSoundings) -> tuple[float, float]:
    """Return the RMSE of the maps of two sets of soundings over the cells that both of them know."""
    west, south, east, north = scenario.rectangle_m
    cell_m = max(CELL_M, scenario.terrain.cell_m)
    grid = Grid(west, south, cell_m, int((north - south) / cell_m), int((east - west) / cell_m))
    true_m = scenario.terrain.depth_at(*np.meshgrid(grid.east_m, grid.north_m))
    maps = [_swath_map(one, grid) if scenario.swath else _single_map(one, grid) for one in (before, after)]
    both = np.isfinite(maps[0]) & np.isfinite(maps[1])
    first, second = (difference(one, true_m, both).rmse_m for one in maps)
    return first, second


def _swath_map(soundings: TrackSoundings, grid: Grid) -> FloatArray:
    density = DensityGrid(grid, np.ones((grid.rows, grid.cols), dtype=bool))
    density.add(soundings.east_m, soundings.north_m, soundings.depth_m, soundings.sd_m)
    return density.depth_m


def _single_map(soundings: TrackSoundings, grid: Grid) -> FloatArray:
    rows = np.arange(0, len(soundings), max(1, len(soundings) // MOST_FOR_MAP))
    columns = soundings.take(rows)
    table = Soundings(columns.east_m, columns.north_m, columns.depth_m, columns.sd_m)
    mask = np.ones((grid.rows, grid.cols), dtype=bool)
    return GaussianProcessMap().fit(table, learn=True).predict(grid, mask).depth_m
