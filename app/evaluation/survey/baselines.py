"""What a user would do instead: lawnmowers, flown by the same vehicles and mapped with the same default map as ours."""

from dataclasses import dataclass

from app.arrays import FloatArray
from app.evaluation.survey.flown import fly_lawnmower
from app.evaluation.survey.world import SOUNDING_RATE_HZ, SPEED_MPS, default_map, rmse_m
from app.exploration.core.constraints import Constraints
from app.mapping.types import Grid
from simulator.floors.terrain import Terrain


@dataclass(frozen=True)
class Baseline:
    """A lawnmower that was flown, and how far its map is from the truth."""

    rmse_m: float
    l2_norm: float
    samples: int
    distance_m: float


@dataclass(frozen=True)
class Baselines:
    """The two lawnmowers that a survey is compared with."""

    same_distance: Baseline
    same_soundings: Baseline


def lawnmower_baseline(
    terrain: Terrain,
    constraints: Constraints,
    starts_m: FloatArray,
    distance_m: float,
    grid: Grid,
    *,
    relative_noise: float = 0.01,
    seed: int = 0,
) -> Baseline:
    """Fly a lawnmower's lines, shared out by what each vehicle can fly, and map the soundings.

    Parameters
    ----------
    constraints : Constraints
        Give the area and its keep-out zones.
    starts_m : (n_vehicles, 3)
        Where the vehicles start, at the surface, and the depth that they keep.
    distance_m : float
        Distance that each vehicle travels at most, circles included; as many lines as it pays for.
    grid : Grid
        Where the map is judged.
    """
    soundings, flown_m = fly_lawnmower(
        terrain, constraints, starts_m, distance_m, relative_noise=relative_noise, seed=seed
    )
    rmse, l2 = rmse_m(default_map(soundings, grid), terrain)
    return Baseline(rmse, l2, len(soundings), flown_m)


def lawnmower_baselines(
    terrain: Terrain,
    constraints: Constraints,
    starts_m: FloatArray,
    distance_m: float,
    soundings: int,
    grid: Grid,
    *,
    relative_noise: float = 0.01,
    seed: int = 0,
) -> Baselines:
    """Return the lawnmower of the same travelled distance, and the one of the same number of soundings.

    Parameters
    ----------
    distance_m : float
        What each vehicle travelled, on average.
    soundings : int
        What the whole team sounded; the second lawnmower travels as far as they take at 5 Hz and 1.3 m/s.
    """
    spacing = SPEED_MPS / SOUNDING_RATE_HZ
    by_distance, by_soundings = (
        lawnmower_baseline(terrain, constraints, starts_m, metres, grid, relative_noise=relative_noise, seed=seed)
        for metres in (distance_m, soundings * spacing / len(starts_m))
    )
    return Baselines(by_distance, by_soundings)
