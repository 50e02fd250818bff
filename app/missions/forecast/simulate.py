"""What is to be expected of a mission: its own planner, decisions and map, flown ahead over floors that are guessed.

How rough the sea floor is decides what comes of a survey, and nobody knows it before. So the mission is flown over
several floors. No vehicle, no network and no clock of the vehicles takes part: legs are straight, and a map is made
twelve times.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.missions.flight.decisions.decision import Knowledge, decide, make_constraints, make_planner
from app.missions.flight.own_legs import LEAST_WAY_M
from app.missions.forecast.floor import Floor, floors_of, forecast_cell_m
from app.missions.forecast.swarm import Flown, StepFlown, Swarm
from app.missions.forecast.swath_flight import sweep_over, sweeps
from app.missions.maps.builder import MapBuilder
from app.missions.spec.mission import MissionSpec, Sensor
from app.missions.team import Member
from simulator.floors.terrain import Terrain

MAPS = 12
LEARN_AT = (1, 4, 12)
"""Maps before which the model is learned anew; in between it is kept."""

LEAST_SD_M = 0.01
BEAMS_RAD = {
    Sensor.SINGLE_BEAM: (0.0,),
    Sensor.DVL: (-np.pi / 8, 0.0, np.pi / 8),
    Sensor.MULTIBEAM: tuple(np.linspace(-np.pi / 3, np.pi / 3, 7)),
}
"""Across the way, from straight down."""


@dataclass(frozen=True)
class Forecast:
    """Flights over several floors that are as likely as each other; at least one."""

    flights: list[Flown]
    floors: list[Floor]

    @property
    def steps_flown(self) -> int:
        """Steps that were flown over every one of the floors."""
        return min(flight.steps for flight in self.flights)


def forecast(
    spec: MissionSpec,
    members: list[Member],
    starts_m: FloatArray,
    prior: FloatArray,
    *,
    floor_depth_m: float | None = None,
    first_step: int = 1,
    budget_s: float,
    patience_s: float = math.inf,
    stop: Callable[[], bool] = lambda: False,
) -> Forecast:
    """Fly a mission ahead, over one floor after the other.

    Parameters
    ----------
    members, starts_m
        The vehicles and where they begin, (vehicles, 2): east, north.
    prior
        Imported soundings, shape (n, 4): east, north, depth, deviation.
    floor_depth_m
        How deep the floor is where nothing was imported; None: a guess.
    first_step
        The first step that is still to be flown.
    budget_s
        How long it may work on each floor, seconds of the processor: a busy machine makes it late, not shorter. What is
        left of the mission then is drawn out.
    patience_s
        After so long by the clock no further floor is begun.
    stop
        Asked at every step whether anyone still wants to know.
    """
    begun = time.monotonic()
    flights: list[Flown] = []
    floors: list[Floor] = []
    for floor in floors_under(spec, members, prior, floor_depth_m):
        if flights and (stop() or time.monotonic() - begun > patience_s):
            break
        floors.append(floor)
        flights.append(fly_over(floor, spec, members, starts_m, prior, first_step, budget_s, stop))
    return Forecast(flights, floors)


def floors_under(
    spec: MissionSpec, members: list[Member], prior: FloatArray, floor_depth_m: float | None = None
) -> Iterator[Floor]:
    """Return the floors that a mission is flown ahead over, one after the other; see :func:`forecast`."""
    return floors_of(spec, prior, max(member.cruise_depth_m(spec.limits) for member in members), floor_depth_m)


def fly_over(
    floor: Floor,
    spec: MissionSpec,
    members: list[Member],
    starts_m: FloatArray,
    prior: FloatArray,
    first_step: int,
    budget_s: float,
    stop: Callable[[], bool] = lambda: False,
) -> Flown:
    """Fly a mission ahead over one floor; see :func:`forecast`."""
    if sweeps(spec):
        return sweep_over(floor, spec, members, starts_m, prior, first_step, budget_s, stop)
    until = time.thread_time() + budget_s
    builder = MapBuilder(
        spec.local_area(), forecast_cell_m(spec), spec.accuracy_m, cell_of_depth=spec.coverage.cell_of_depth
    )
    builder.arrivals.replace(np.zeros((0, 4)), prior)
    builder.build()
    steps = max(spec.steps - first_step + 1, 0)
    every = max(1, steps // MAPS)
    distance, seconds, left_m, flown = np.zeros(len(members)), 0.0, 0.0, 0
    for leg in fly(spec, members, starts_m, builder, floor.terrain, first_step=first_step):
        distance, seconds, left_m, flown = leg.distance_m, leg.seconds, leg.left_m, flown + 1
        if flown % every == 0:
            builder.build()
            if flown // every in LEARN_AT:
                builder.learn(always=True)
        if stop() or time.thread_time() > until:
            break
    builder.build()
    whole = 1.0 + left_m / distance.sum() if distance.sum() > 0.0 else 1.0
    newest = builder.newest
    return Flown(
        duration_s=seconds * whole,
        distances_m={member.name: float(distance[i]) * whole for i, member in enumerate(members)},
        coverage_pct=builder.coverage_pct(),
        remaining_pct=builder.remaining_pct(),
        mean_sd_m=newest.mean_sd_m if newest is not None else None,
        steps=steps if left_m <= LEAST_WAY_M * len(members) else flown,
    )


def fly(
    spec: MissionSpec,
    members: list[Member],
    starts_m: FloatArray,
    builder: MapBuilder,
    terrain: Terrain,
    *,
    first_step: int = 1,
    spacing_m: float | None = None,
) -> Iterator[StepFlown]:
    """Fly a mission's steps by its own planner and decisions; soundings go to ``builder``, whose maps are the caller's.

    ``spacing_m`` is the way between soundings; None: a cell of the terrain.
    """
    constraints, planner = make_constraints(spec), make_planner(spec)
    rng = np.random.default_rng([spec.seed, 1])
    swarm = Swarm(spec, members, starts_m, first_step)
    apart = planner.decides_apart and np.isinf(constraints.com_range_m)
    told = first_step - 1
    while (due := swarm.due(apart=apart)).any():
        number = int(swarm.legs[due].max()) + 1
        known = Knowledge(builder.belief(), builder.sounded_at_m()[0])
        decision = decide(number, spec, constraints, planner, swarm.places(due), known)
        target = {leg.vehicle: leg.target_m for leg in decision.legs}
        for i in np.flatnonzero(due):
            member = members[i]
            way = swarm.here[i].copy(), target.get(member.name, swarm.here[i])
            builder.add(_sounded(member.spec.sensor, *way, terrain, spec.sounding_noise, rng, spacing_m))
            swarm.fly(int(i), way[1])
        if number > told:
            told = number
            yield swarm.flown(number)


def _sounded(
    sensor: Sensor,
    start: FloatArray,
    end: FloatArray,
    floor: Terrain,
    noise: float,
    rng: np.random.Generator,
    spacing_m: float | None,
) -> FloatArray:
    """Return what is sounded on a leg, shape (n, 4): east, north, depth, deviation."""
    way = end[:2] - start[:2]
    length = float(np.linalg.norm(way))
    count = max(1, int(np.ceil(length / (spacing_m or floor.cell_m))))
    along = start + np.linspace(1 / count, 1, count)[:, None] * (end - start)
    across = np.array([way[1], -way[0]]) / length if length > 0 else np.zeros(2)
    found = []
    for angle in BEAMS_RAD[sensor]:
        under = floor.depth_at(along[:, 0], along[:, 1])
        reach = np.tan(angle) * np.maximum(under - along[:, 2], 0.0)
        place = along[:, :2] + reach[:, None] * across
        depth = floor.depth_at(place[:, 0], place[:, 1])
        sd = np.maximum(noise * (depth - along[:, 2]) / np.cos(angle), LEAST_SD_M)
        found.append(np.column_stack([place, depth + rng.normal(size=count) * np.nan_to_num(sd), sd]))
    rows = np.concatenate(found)
    used: FloatArray = rows[np.isfinite(rows).all(axis=1) & (rows[:, 2] > 0)]
    return used
