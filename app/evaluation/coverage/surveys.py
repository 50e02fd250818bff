"""The surveys that are compared: ours, with and without known depths, and the usual ones."""

from collections import Counter

import numpy as np

from app.arrays import FloatArray
from app.evaluation.coverage.world import CRUISE_M, CoverageScenario, Fleet, SurveyCraft
from app.exploration.lines.lattice import longer_axis_rad
from app.exploration.swath.raster import Axes
from app.exploration.swath.survey import SwathSurvey

LEG_WIDTHS = 1.0
"""Longest leg along a line, in half widths of the swath: what was measured under way bends the rest."""

LEAST_LEG_M = 5.0
MOST_LEGS = 20_000
IDLE_S = 20.0
"""How long a vehicle without a line waits until it is looked at again,"""
MOST_IDLE = 2
"""and how often in a row there is nothing for it until it is done."""
DUNE_SAMPLES = 40
"""Altitudes that DUNE's rows take the mean of."""
LEAST_ALTITUDE_M = 0.3
EDGE_STEP_M = 10.0
EDGE_OVERLAP = 0.2
STEEPEST_BEND = float(np.tan(np.radians(60.0)))


def fly_ours(scenario: CoverageScenario, *, known: bool = False) -> Fleet:
    """Fly our survey; with ``known`` every depth is told before."""
    fleet = Fleet(scenario)
    prior = scenario.true_depth_m() if known else None
    flying = scenario.flying
    terrain = scenario.terrain
    area = np.array([[0, 0], [terrain.width_m, 0], [terrain.width_m, terrain.height_m], [0, terrain.height_m]])
    survey = SwathSurvey(longer_axis_rad(area.astype(float)), fleet.coverage().cell_m, CRUISE_M + 5.0)
    idle: Counter[str] = Counter()
    for _ in range(MOST_LEGS):
        name = min(fleet.crafts, key=lambda one: max(fleet.crafts[one].time_s, fleet.crafts[one].idle_until_s))
        craft = fleet.crafts[name]
        below_m = np.array([terrain.depth_at_point(float(craft.pose[0]), float(craft.pose[1]))])
        width_m = float(flying.half_width_m(np.nan_to_num(below_m, nan=CRUISE_M + 5.0))[0])
        team = {other: fleet.crafts[other].pose for other in fleet.crafts}
        leg_m = max(LEG_WIDTHS * width_m, LEAST_LEG_M)
        end = survey.next_leg(name, craft.pose, flying, fleet.coverage(prior), team, leg_m)
        if end is None and len(craft.unseen):
            fleet.take_in(craft)
            idle.clear()
            continue
        if end is None:
            survey.expect_nothing(name)
            idle[name] += 1
            if all(idle[one] >= MOST_IDLE for one in fleet.crafts):
                break
            craft.idle_until_s = max(craft.time_s, craft.idle_until_s) + IDLE_S
            continue
        idle.clear()
        craft.time_s = max(craft.time_s, craft.idle_until_s)
        ahead = survey.lines_m().get(name)
        entering = (
            ahead is not None and len(ahead) > 1 and np.allclose(ahead[0], end) and not _in_line(craft, end, ahead)
        )
        heading = float(np.arctan2(*(ahead[1] - ahead[0]))) if entering and ahead is not None else None
        fleet.fly_to(craft, end, heading)
    return fleet


def fly_fixed(scenario: CoverageScenario) -> Fleet:
    """Fly parallel lines whose spacing leaves no gap where the area is shoalest: known beforehand."""
    depth = scenario.true_depth_m()[scenario.wanted()]
    half_m = float(scenario.flying.half_width_m(np.array([depth.min()]))[0])
    spacing_m = max(2.0 * half_m * (1.0 - 0.5 * scenario.overlap), scenario.cell_m)
    return _fly_rows(scenario, spacing_m)


def _fly_rows(scenario: CoverageScenario, spacing_m: float) -> Fleet:
    fleet = Fleet(scenario)
    low, high, axes = _across(scenario)
    count = max(1, int(np.ceil((high - low) / spacing_m - 1e-9)))
    at = low + (np.arange(count) + 0.5) * (high - low) / count
    lines = [line for line in (_line(scenario, axes, float(a)) for a in at) if line is not None]
    for share, craft in zip(
        np.array_split(np.arange(len(lines)), scenario.vehicles), fleet.crafts.values(), strict=True
    ):
        for k in share:
            path = lines[k]
            _fly_nearer(fleet, craft, path)
    return fleet


def fly_dune_rows(scenario: CoverageScenario) -> Fleet:
    """Fly rows as DUNE's coverage maneuver: the next one as far as the mean of the last altitudes lets it be."""
    fleet = Fleet(scenario)
    low, high, axes = _across(scenario)
    terrain, flying = scenario.terrain, scenario.flying
    borders = np.linspace(low, high, scenario.vehicles + 1)
    for craft, begin, end in zip(fleet.crafts.values(), borders[:-1], borders[1:], strict=True):
        at = float(begin)
        step_m = 0.0
        while at < end:
            line = _line(scenario, axes, min(at + 0.5 * step_m, float(end)))
            if line is not None:
                _fly_nearer(fleet, craft, line)
                samples = line[0] + np.linspace(0.0, 1.0, 200)[:, None] * (line[1] - line[0])
                altitudes = flying.altitude_m(terrain.depth_at(samples[:, 0], samples[:, 1]))
                altitudes = altitudes[np.isfinite(altitudes) & (altitudes > LEAST_ALTITUDE_M)][-DUNE_SAMPLES:]
                mean = float(altitudes.mean()) if len(altitudes) else 1.0
            else:
                mean = 1.0
            step_m = 2.0 * mean * flying.sonar.reach * (1.0 - 0.5 * scenario.overlap)
            at += step_m
    return fleet


def fly_from_edges(scenario: CoverageScenario) -> Fleet:
    """Fly each line a swath beyond the edge of the last one, looked at every ten metres, bends of 60 degrees cut."""
    fleet = Fleet(scenario)
    low, high, axes = _across(scenario)
    terrain, flying = scenario.terrain, scenario.flying
    borders = np.linspace(low, high, scenario.vehicles + 1)
    along = axes.turned(_corners(scenario))[:, 0]
    stations = np.append(np.arange(along.min(), along.max(), EDGE_STEP_M), along.max())

    def width_m(across: FloatArray) -> FloatArray:
        places = axes.to_en(np.column_stack([stations, across]))
        depth = terrain.depth_at(places[:, 0], places[:, 1])
        known = np.isfinite(depth)
        depth = np.interp(stations, stations[known], depth[known]) if known.any() else np.full(len(stations), 3.0)
        return np.maximum(flying.half_width_m(depth), 0.5 * scenario.cell_m)

    for craft, begin, end in zip(fleet.crafts.values(), borders[:-1], borders[1:], strict=True):
        edge = np.full(len(stations), float(begin))
        while (edge < end - 1e-6).any():
            width = width_m(edge)
            across = np.minimum(edge + width * (1.0 - EDGE_OVERLAP), end)
            for k in range(1, len(across)):
                most = STEEPEST_BEND * (stations[k] - stations[k - 1])
                across[k] = np.clip(across[k], across[k - 1] - most, across[k - 1] + most)
            path = axes.to_en(np.column_stack([stations, across]))
            needed = np.flatnonzero(edge < end - 1e-6)
            path = path[needed[0] : max(needed[-1] + 1, needed[0] + 2)]
            if len(path) > 1:
                _fly_nearer(fleet, craft, path)
            edge = np.maximum(edge, across + width_m(across))
    return fleet


def _fly_nearer(fleet: Fleet, craft: SurveyCraft, path: FloatArray) -> None:
    """Fly a line from its nearer end."""
    back = np.hypot(*(path[-1] - craft.pose[:2])) < np.hypot(*(path[0] - craft.pose[:2]))
    fleet.fly_along(craft, path[::-1] if back else path)


def _in_line(craft: SurveyCraft, end: FloatArray, ahead: FloatArray) -> bool:
    """Whether a leg goes on in the direction of the line."""
    leg, line = end - craft.pose[:2], ahead[1] - ahead[0]
    cosine = float(leg @ line) / max(float(np.hypot(*leg) * np.hypot(*line)), 1e-9)
    heading = abs((float(np.arctan2(*leg)) - craft.pose[2] + np.pi) % (2 * np.pi) - np.pi)
    return cosine > 0.9 and heading < 0.45


def _corners(scenario: CoverageScenario) -> FloatArray:
    places = np.argwhere(scenario.wanted())
    south, west = places.min(axis=0) * scenario.cell_m
    north, east = (places.max(axis=0) + 1) * scenario.cell_m
    return np.array([[west, south], [east, south], [east, north], [west, north]])


def _across(scenario: CoverageScenario) -> tuple[float, float, Axes]:
    corners = _corners(scenario)
    axes = Axes(longer_axis_rad(corners))
    across = axes.turned(corners)[:, 1]
    return float(across.min()), float(across.max()), axes


def _line(scenario: CoverageScenario, axes: Axes, across: float) -> FloatArray | None:
    """Return the part of a line over wanted ground, (2, 2); None without any."""
    along = axes.turned(_corners(scenario))[:, 0]
    at = np.arange(along.min(), along.max() + 1e-9, scenario.cell_m)
    places = axes.to_en(np.column_stack([at, np.full(len(at), across)]))
    grid, wanted = scenario.grid, scenario.wanted()
    rows = np.clip(((places[:, 1] - grid.south_m) / grid.cell_m).astype(int), 0, grid.rows - 1)
    cols = np.clip(((places[:, 0] - grid.west_m) / grid.cell_m).astype(int), 0, grid.cols - 1)
    inside = np.flatnonzero(wanted[rows, cols])
    return None if len(inside) < 2 else places[[inside[0], inside[-1]]]
