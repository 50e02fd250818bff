"""Survey lines flown by simulated vehicles, which build up speed, turn in circles and dive."""

import numpy as np

from app.arrays import FloatArray
from app.evaluation.survey.world import SPEED_MPS
from app.exploration.core.constraints import Constraints
from app.exploration.lines.lawnmower import lawnmower_routes
from app.mapping.types import Soundings
from simulator.equipment import Equipment
from simulator.floors.terrain import Terrain
from simulator.sonars.sensors import SonarNoise
from simulator.world import BeamReturn, SimulatedVehicle

ARRIVAL_RADIUS_M = 3.0
"""A corner counts as reached within this distance, as in missions."""
TICK_S = 0.2
FEWER_LINES = 0.97
"""Each try to find lines that can be finished plans with at most this share of the way of the one before."""
TRIES = 12
LEAST_SD_M = 1e-3


def fly_lawnmower(
    terrain: Terrain,
    constraints: Constraints,
    starts_m: FloatArray,
    distance_m: float,
    *,
    relative_noise: float,
    seed: int,
) -> tuple[Soundings, float]:
    """Fly even lines with simulated vehicles; return the soundings and the distance that all travelled.

    As many lines as can be finished with ``distance_m`` per vehicle, turning circles included. ``starts_m`` is
    (n_vehicles, 3), depths positive down.
    """
    budget_m = distance_m
    equipment = Equipment(noise=SonarNoise(relative_noise))
    for _ in range(TRIES):
        routes = lawnmower_routes(constraints, starts_m[:, :2], np.full(len(starts_m), budget_m))
        rng = np.random.default_rng([seed, 2])
        vehicles = [
            SimulatedVehicle(f"lawnmower-{i + 1}", terrain, [*start[:2], 0.0], stream, equipment)
            for i, (start, stream) in enumerate(zip(starts_m, rng.spawn(len(starts_m)), strict=True))
        ]
        measured: list[BeamReturn] = []
        finished = True
        for vehicle, route, start in zip(vehicles, routes, starts_m, strict=True):
            done, heard = _fly(vehicle, route, float(start[2]), distance_m)
            measured += heard
            finished &= done
        if finished:
            break
        budget_m *= FEWER_LINES
    return _soundings(measured, relative_noise), sum(vehicle.vehicle.distance_m for vehicle in vehicles)


def _fly(
    vehicle: SimulatedVehicle, route: FloatArray, depth_m: float, distance_m: float
) -> tuple[bool, list[BeamReturn]]:
    """Follow a route (k, 2) for at most a distance; return whether its end was reached, and the soundings."""
    heard: list[BeamReturn] = []
    for east, north in route:
        vehicle.go_to(float(east), float(north), depth_m, SPEED_MPS, arrival_radius_m=ARRIVAL_RADIUS_M)
        while not vehicle.arrived:
            if vehicle.vehicle.distance_m >= distance_m:
                return False, heard
            heard += vehicle.advance(TICK_S)
    return True, heard


def _soundings(measured: list[BeamReturn], relative_noise: float) -> Soundings:
    found = [(m.footprint, m.range_m) for m in measured if m.footprint is not None]
    places = np.array([(p.east_m, p.north_m, p.depth_m) for p, _ in found]).reshape(-1, 3)
    sd = np.maximum(relative_noise * np.array([r for _, r in found]), LEAST_SD_M)
    return Soundings(places[:, 0], places[:, 1], places[:, 2], sd)
