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

from app.arrays import BoolArray, FloatArray
from app.missions.flight.commit import STILL_M
from app.missions.flight.decision import (
    Knowledge,
    Place,
    decide,
    make_constraints,
    make_planner,
    planned_way_m,
    turn_radius_m,
)
from app.missions.flight.own_legs import HARDLY_BEGUN, LEAST_WAY_M
from app.missions.forecast.floor import Floor, floors_of, forecast_cell_m
from app.missions.maps.builder import MapBuilder
from app.missions.spec.mission import MissionSpec, Sensor
from app.missions.team import Member
from simulator.terrain import Terrain

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


@dataclass(frozen=True)
class StepFlown:
    """How far vehicles have come after a step: metres each, (vehicles,), and the vehicles' seconds."""

    step: int
    distance_m: FloatArray
    seconds: float
    left_m: float
    """How far all of them together may still fly."""
    here_m: FloatArray
    """Where their legs end, (vehicles, 2): east, north."""


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


class Swarm:
    """Vehicles without a body: straight legs at their speed, and a while for every turn.

    Attributes
    ----------
    here : (n, 3)
        Where their last legs end.
    heading_rad, clock_s, distance_m, left_m : (n,)
        Their course then (NaN: none yet), when that is, and how far they have come and may still go.
    legs : (n,)
        How many they had.
    """

    def __init__(self, spec: MissionSpec, members: list[Member], starts_m: FloatArray, first_step: int) -> None:
        self._spec, self._members = spec, members
        self._speed_mps = np.array([spec.speed_of(member.spec) for member in members])
        self._radius_m = np.array([turn_radius_m(spec, member.spec) for member in members])
        n = len(members)
        self.here = np.column_stack([starts_m, np.zeros(n)])
        self.heading_rad = np.full(n, np.nan)
        self.clock_s, self.distance_m = np.zeros(n), np.zeros(n)
        self.legs = np.full(n, first_step - 1)
        if spec.budget.steps is not None:
            self.left_m = np.full(n, max(spec.steps - first_step + 1, 0) * spec.limits.max_step_m)
        else:
            self.left_m = np.array([member.way_left_m(spec) for member in members])

    def flown(self, step: int) -> StepFlown:
        """Return how far they have come after a step."""
        left_m, seconds = float(self.left_m.sum()), float(self.clock_s.max())
        return StepFlown(step, self.distance_m.copy(), seconds, left_m, self.here[:, :2].copy())

    def due(self, *, apart: bool) -> BoolArray:
        """Return who gets the next leg, (n,): all together, or who ends its last one first, with those right after."""
        able = self.left_m > LEAST_WAY_M
        if not apart or not able.any():
            return able
        soon_s = self.clock_s[able].min() + HARDLY_BEGUN * self._spec.limits.max_step_m / self._speed_mps
        return np.asarray(able & (self.clock_s <= soon_s))

    def places(self, due: BoolArray) -> list[Place]:
        """Return where legs begin, for a decision."""
        return [
            Place(
                member.name,
                self.here[i, :2],
                float(self.heading_rad[i]),
                member.cruise_depth_m(self._spec.limits),
                keeps_depth=member.capabilities.keeps_depth,
                moving=bool(due[i]),
                left_m=planned_way_m(self._spec, float(self.left_m[i])),
                altitude_m=member.altitude_m,
            )
            for i, member in enumerate(self._members)
        ]

    def fly(self, i: int, end: FloatArray) -> None:
        """Bring one vehicle to the end of its leg, (3,)."""
        east, north = end[:2] - self.here[i, :2]
        leg_m, step_m = float(np.linalg.norm(end - self.here[i])), self._spec.limits.max_step_m
        if math.hypot(east, north) > 0.0:
            course = math.atan2(east, north)
            turn = 0.0 if np.isnan(self.heading_rad[i]) else abs(math.remainder(course - self.heading_rad[i], math.tau))
            self.heading_rad[i] = course
            self.clock_s[i] += turn * self._radius_m[i] / self._speed_mps[i]
        counts_m = step_m if self._spec.budget.steps is not None or leg_m <= STILL_M else leg_m
        self.left_m[i] = max(self.left_m[i] - counts_m, 0.0)
        self.legs[i] += 1
        self.distance_m[i] += leg_m
        self.clock_s[i] += (counts_m if leg_m <= STILL_M else leg_m) / self._speed_mps[i]
        self.here[i] = end


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
