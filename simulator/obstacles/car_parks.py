"""Car parks of 150 x 150 m in three degrees of difficulty (ACCESS13, section V), and a harbour basin.

ACCESS13 shows its car parks in figures only. These are drawn by their descriptions: barrels are known beforehand,
parked cars are not; the third one holds a wall of vehicles that traps a robot heading straight for the goal.
"""

from __future__ import annotations

import numpy as np

from simulator.arrays import BoolArray
from simulator.obstacles.obstacles import ObstacleWorld

SIDE = 150
"""Cells of 1 m per side."""
CAR = (5, 2)
STALL = 3
AISLE = 8
CLEAR = 6.0
"""Radius about entry and goal without parked cars."""

SCENARIOS = (1, 2, 3)


def car_park(scenario: int, seed: int = 0) -> ObstacleWorld:
    """Draw a car park; the same arguments give the same one.

    1: rows of stalls, half of them taken. 2: four blocks of rows in both directions, four of five taken, and cars that
    stand in the aisles. 3: as the first, with a bay of vehicles parked without a gap between entry and goal, open
    towards the entry.

    Raises
    ------
    ValueError
        For another scenario.
    """
    if scenario not in SCENARIOS:
        raise ValueError(f"scenario is {scenario}; it must be one of {', '.join(map(str, SCENARIOS))}")
    rng = np.random.default_rng([seed, scenario])
    cars = np.zeros((SIDE, SIDE), dtype=np.bool_)
    if scenario == 2:
        half = SIDE // 2
        for block in range(4):
            part = _rows(half, half, 0.8, rng)
            r, c = divmod(block, 2)
            cars[r * half : (r + 1) * half, c * half : (c + 1) * half] = part if (r + c) % 2 == 0 else part.T
        _strays(cars, 30, rng)
    else:
        cars = _rows(SIDE, SIDE, 0.5, rng)
    entry, goal = np.array([10.5, 10.5]), np.array([100.5, 100.5])
    if scenario == 3:
        _bay(cars, rng)
    barrels = np.zeros_like(cars)
    where = rng.integers(0, SIDE, (40, 2))
    barrels[where[:, 0], where[:, 1]] = True
    north, east = np.indices(cars.shape) + 0.5
    for place in (entry, goal):
        open_ = np.hypot(east - place[0], north - place[1]) < CLEAR
        cars &= ~open_
        barrels &= ~open_
    barrels &= ~cars
    return ObstacleWorld(f"car park {scenario}", cars | barrels, barrels, 1.0, entry, goal, entry)


def harbour_basin(seed: int = 0) -> ObstacleWorld:
    """Draw a harbour of 150 x 150 m: quays and a pier are on the chart, moored boats and pontoons are not."""
    rng = np.random.default_rng([seed, 7])
    quays = np.zeros((SIDE, SIDE), dtype=np.bool_)
    quays[:, :6] = quays[-6:, :] = quays[:, -6:] = True
    quays[:6, : SIDE // 2 - 15] = quays[:6, SIDE // 2 + 15 :] = True
    pier = int(rng.integers(55, 75))
    quays[60:, pier : pier + 6] = True
    afloat = np.zeros_like(quays)
    for north in (40, 75, 110):
        length = int(rng.integers(25, 40))
        afloat[north : north + 2, SIDE - 6 - length : SIDE - 6] = True
        for east in range(SIDE - 6 - length, SIDE - 9, 5):
            for side in (-6, 2):
                if rng.random() < 0.6:
                    afloat[north + side : north + side + 6, east : east + 2] = True
    _strays(afloat, 12, rng)
    entry, goal = np.array([75.5, 9.5]), np.array([32.5, 118.5])
    north, east = np.indices(quays.shape) + 0.5
    for place in (entry, goal):
        afloat &= np.hypot(east - place[0], north - place[1]) >= CLEAR
    return ObstacleWorld("harbour basin", quays | afloat, quays, 1.0, entry, goal, entry)


def _rows(height: int, width: int, taken: float, rng: np.random.Generator) -> BoolArray:
    """Return double rows of stalls, west to east, with aisles between and cross aisles at both ends."""
    cars = np.zeros((height, width), dtype=np.bool_)
    long, wide = CAR
    for south in range(AISLE, height - 2 * long, 2 * long + AISLE):
        for row in (south, south + long):
            for west in range(AISLE, width - AISLE - wide, STALL):
                if rng.random() < taken:
                    cars[row : row + long, west : west + wide] = True
    return cars


def _strays(solid: BoolArray, count: int, rng: np.random.Generator) -> None:
    """Let single cars (or boats) stand where they should not."""
    for _ in range(count):
        long, wide = CAR if rng.random() < 0.5 else CAR[::-1]
        south, west = rng.integers(8, SIDE - 14, 2)
        solid[south : south + long, west : west + wide] = True


def _bay(cars: BoolArray, rng: np.random.Generator) -> None:
    """Close a bay of lorries about the straight way from entry to goal, open towards the entry."""
    corner = int(rng.integers(68, 76))
    clear = slice(24, corner + 3)
    cars[clear, clear] = False
    cars[corner : corner + 3, 30 : corner + 3] = True
    cars[30 : corner + 3, corner : corner + 3] = True
