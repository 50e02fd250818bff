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
from app.exploration.planners import create_planner
from app.missions.flight.decision import Place, decide, make_constraints
from app.missions.forecast.floor import Floor, floors_of, forecast_cell_m
from app.missions.maps.builder import MapBuilder
from app.missions.spec.mission import MissionSpec, Sensor
from app.missions.team import Member
from simulator.terrain import Terrain

MAPS = 12
LEARN_AT = (1, 4, 12)
"""Maps before which the model is learned anew; in between it is kept."""

LEAST_SD_M = 0.01
TURN_S = 2.0
"""What a vehicle takes for a waypoint beyond its way: it turns, and the next decision is made."""

BEAMS_RAD = {
    Sensor.SINGLE_BEAM: (0.0,),
    Sensor.DVL: (-np.pi / 8, 0.0, np.pi / 8),
    Sensor.MULTIBEAM: tuple(np.linspace(-np.pi / 3, np.pi / 3, 7)),
}
"""Across the way, from straight down."""


@dataclass(frozen=True)
class Flown:
    """What one flight came to. ``steps`` is less than asked for when the time was up; then the rest is drawn out.

    ``distances_m`` has every vehicle's way, ``remaining_pct`` the landmarks that are not known in the end.
    """

    duration_s: float
    distances_m: dict[str, float]
    coverage_pct: float
    remaining_pct: float
    mean_sd_m: float | None
    steps: int


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
    cruise = max(member.cruise_depth_m(spec.limits) for member in members)
    flights: list[Flown] = []
    floors: list[Floor] = []
    for floor in floors_of(spec, prior, cruise, floor_depth_m):
        if flights and (stop() or time.monotonic() - begun > patience_s):
            break
        floors.append(floor)
        flights.append(_fly_over(floor, spec, members, starts_m, prior, first_step, budget_s, stop))
    return Forecast(flights, floors)


def _fly_over(
    floor: Floor,
    spec: MissionSpec,
    members: list[Member],
    starts_m: FloatArray,
    prior: FloatArray,
    first_step: int,
    budget_s: float,
    stop: Callable[[], bool],
) -> Flown:
    until = time.thread_time() + budget_s
    builder = MapBuilder(spec.local_area(), forecast_cell_m(spec), spec.accuracy_m)
    builder.arrivals.replace(np.zeros((0, 4)), prior)
    builder.build()
    steps = max(spec.steps - first_step + 1, 0)
    every = max(1, steps // MAPS)
    distance, seconds, flown = np.zeros(len(members)), 0.0, 0
    for leg in fly(spec, members, starts_m, builder, floor.terrain, first_step=first_step):
        distance, seconds, flown = leg.distance_m, leg.seconds, flown + 1
        if flown % every == 0:
            builder.build()
            if flown // every in LEARN_AT:
                builder.learn(always=True)
        if stop() or time.thread_time() > until:
            break
    builder.build()
    whole = steps / flown if flown else 1.0
    newest = builder.newest
    return Flown(
        duration_s=seconds * whole,
        distances_m={member.name: float(distance[i]) * whole for i, member in enumerate(members)},
        coverage_pct=builder.coverage_pct(),
        remaining_pct=builder.remaining_pct(),
        mean_sd_m=newest.mean_sd_m if newest is not None else None,
        steps=flown,
    )


@dataclass(frozen=True)
class StepFlown:
    """How far vehicles have come after a step: metres each, (vehicles,), and the vehicles' seconds."""

    step: int
    distance_m: FloatArray
    seconds: float


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
    cruise = [member.cruise_depth_m(spec.limits) for member in members]
    constraints, planner = make_constraints(spec), create_planner(spec.planner.name, spec.planner.options)
    rng = np.random.default_rng([spec.seed, 1])
    here = np.column_stack([starts_m, np.zeros(len(members))])
    heading = np.full(len(members), np.nan)
    distance, seconds = np.zeros(len(members)), 0.0
    for step in range(first_step, spec.steps + 1):
        places = [
            Place(member.name, here[i, :2], float(heading[i]), cruise[i], keeps_depth=member.capabilities.keeps_depth)
            for i, member in enumerate(members)
        ]
        decision = decide(step, spec, constraints, planner, places, builder.belief(), builder.sounded_at_m()[0])
        target = {leg.vehicle: leg.target_m for leg in decision.legs}
        longest = 0.0
        for i, member in enumerate(members):
            end = target.get(member.name, here[i])
            leg_m = float(np.linalg.norm(end - here[i]))
            way = here[i], end
            builder.add(_sounded(member.spec.sensor, *way, terrain, spec.sounding_noise, rng, spacing_m))
            if leg_m > 0.0:
                heading[i] = float(np.arctan2(end[0] - here[i, 0], end[1] - here[i, 1]))
            distance[i] += leg_m
            longest = max(longest, leg_m)
            here[i] = end
        seconds += min(longest / spec.speed_mps + TURN_S, spec.step_deadline_s)
        yield StepFlown(step, distance.copy(), seconds)


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
