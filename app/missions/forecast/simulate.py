"""What is to be expected of a mission: its own planner, decisions and map, flown ahead over floors that are guessed.

How rough the sea floor is decides what comes of a survey, and nobody knows it before. So the mission is flown over
several floors. No vehicle and no network takes part: vehicles steer in their turning circles, and fewer maps
are made than at sea.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.missions.flight.decisions.decision import Knowledge, decide
from app.missions.forecast.floor import Floor, floors_of, forecast_cell_m
from app.missions.forecast.swarm import FlightOutcome, SoFar, StepFlown, Swarm, planner_of, poses_apart
from app.missions.forecast.swath_flight import sweep_over, sweeps
from app.missions.maps.builder import MapBuilder
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import Sensor
from app.missions.task.constraints import limits_of_decisions, make_constraints
from app.missions.task.way import least_way_m
from app.missions.team import Member
from simulator.floors.terrain import Terrain

MORE = 1.3
"""A map is made whenever so many times as many steps are flown as for the last one: at sea each step has a new one, and
the first ones say the most."""
LEARN_EVERY = 4
"""Before so many maps the model is learned anew, as before the last one."""

SOUNDINGS_HZ = 5.0
"""How often single beams sound."""
SOUNDINGS_A_CELL = 8.0
"""More soundings on the way along a cell are not taken: they are as good as one."""

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

    flights: list[FlightOutcome]
    floors: list[Floor]

    @property
    def steps_flown(self) -> int:
        """Steps that were flown over every one of the floors."""
        return min(flight.steps for flight in self.flights)


def forecast(
    spec: MissionSpec,
    members: list[Member],
    starts_m: FloatArray,
    so_far: SoFar,
    *,
    floor_depth_m: float | None = None,
    budget_s: float,
    patience_s: float = math.inf,
    stop: Callable[[], bool] = lambda: False,
) -> Forecast:
    """Fly a mission ahead, over one floor after the other.

    Parameters
    ----------
    members, starts_m
        The vehicles and where they begin, (vehicles, 2): east, north.
    so_far
        What was done of it.
    floor_depth_m
        How deep the floor is where nothing was sounded or imported; None: a guess.
    budget_s
        How long it may work on each floor, seconds of the processor: a busy machine makes it late, not shorter. What is
        left of the mission then is drawn out.
    patience_s
        After so long by the clock no further floor is begun.
    stop
        Asked at every step whether anyone still wants to know.
    """
    begun = time.monotonic()
    flights: list[FlightOutcome] = []
    floors: list[Floor] = []
    for floor in floors_under(spec, members, so_far, floor_depth_m):
        if flights and (stop() or time.monotonic() - begun > patience_s):
            break
        floors.append(floor)
        flights.append(fly_over(floor, spec, members, starts_m, so_far, budget_s, stop))
    return Forecast(flights, floors)


def floors_under(
    spec: MissionSpec, members: list[Member], so_far: SoFar, floor_depth_m: float | None = None
) -> Iterator[Floor]:
    """Return the floors that a mission is flown ahead over, one after the other; see :func:`forecast`."""
    return floors_of(spec, so_far.rows, max(member.cruise_depth_m(spec.limits) for member in members), floor_depth_m)


def fly_over(
    floor: Floor,
    spec: MissionSpec,
    members: list[Member],
    starts_m: FloatArray,
    so_far: SoFar,
    budget_s: float,
    stop: Callable[[], bool] = lambda: False,
) -> FlightOutcome:
    """Fly a mission ahead over one floor; see :func:`forecast`."""
    if sweeps(spec):
        return sweep_over(floor, spec, members, starts_m, so_far, budget_s, stop)
    until = time.thread_time() + budget_s
    builder = MapBuilder(
        spec.local_area(), forecast_cell_m(spec), spec.accuracy_m, cell_of_depth=spec.coverage.cell_of_depth
    )
    builder.arrivals.replace(so_far.soundings, so_far.prior)
    builder.build()
    steps = max(spec.steps - so_far.first_step + 1, 0)
    distance, seconds, left_m, flown = np.zeros(len(members)), 0.0, 0.0, 0
    legs = fly(spec, members, starts_m, builder, floor.terrain, so_far)
    for leg in with_maps(legs, builder, so_far.first_step):
        distance, seconds, left_m, flown = leg.distance_m, leg.seconds, leg.left_m, flown + 1
        if stop() or time.thread_time() > until:
            break
    builder.learn(always=True)
    builder.build()
    whole = 1.0 + left_m / distance.sum() if distance.sum() > 0.0 else 1.0
    newest = builder.newest
    return FlightOutcome(
        duration_s=seconds * whole,
        distances_m={member.name: float(distance[i]) * whole for i, member in enumerate(members)},
        coverage_pct=builder.coverage_pct(),
        remaining_pct=builder.remaining_pct(),
        mean_sd_m=newest.mean_sd_m if newest is not None else None,
        steps=steps if left_m <= least_way_m(spec) * len(members) else flown,
    )


def with_maps(legs: Iterator[StepFlown], builder: MapBuilder, first_step: int = 1) -> Iterator[StepFlown]:
    """Make maps of what is sounded while steps are flown, as often as a forecast does: planners plan by them."""
    mapped, maps = first_step - 1, 0
    for leg in legs:
        if leg.step >= MORE * mapped:
            builder.build()
            mapped, maps = leg.step, maps + 1
            if maps % LEARN_EVERY == 0:
                builder.learn(always=True)
        yield leg


def fly(
    spec: MissionSpec,
    members: list[Member],
    starts_m: FloatArray,
    builder: MapBuilder,
    terrain: Terrain,
    so_far: SoFar = SoFar(),  # noqa: B008 - frozen
    *,
    spacing_m: float | None = None,
) -> Iterator[StepFlown]:
    """Fly a mission's steps by its own planner and decisions; soundings go to ``builder``, whose maps are the caller's.

    Without maps on the way (:func:`with_maps`) planners that adapt to what was found have nothing to adapt to.

    ``spacing_m`` is the way between soundings; None: as sonars sound, or closer than the terrain's cells are.
    """
    constraints, planner = make_constraints(spec), planner_of(spec, so_far)
    rng = np.random.default_rng([spec.seed, 1])
    swarm = Swarm(spec, members, starts_m, so_far.first_step)
    apart = planner.decides_apart and np.isinf(constraints.com_range_m)
    if apart:
        constraints = limits_of_decisions(constraints, planner.planner)

    def sound(i: int, poses: FloatArray) -> None:
        apart_m = spacing_m or max(spec.speed_of(members[i].spec) / SOUNDINGS_HZ, terrain.cell_m / SOUNDINGS_A_CELL)
        builder.add(_sounded(members[i].spec.sensor, poses, terrain, spec.sounding_noise, rng, apart_m))

    for i in range(len(members)):
        for end in swarm.legs_ahead(i):
            sound(i, swarm.fly(i, end, ahead=True))
    told, untold = so_far.first_step - 1, False
    while (due := swarm.due(apart=apart)).any():
        number = int(swarm.legs[due].max()) + 1
        known = Knowledge(builder.belief(), builder.sounded_at_m()[0])
        decision = decide(number, spec, constraints, planner, swarm.places(due), known)
        target = {leg.vehicle: leg.target_m for leg in decision.legs}
        for i in map(int, np.flatnonzero(due)):
            if members[i].name in decision.done:
                swarm.end(i)
                continue
            sound(i, swarm.fly(i, target.get(members[i].name, swarm.here[i])))
        untold = number <= told
        if not untold:
            told = number
            yield swarm.flown(number)
    if untold:
        yield swarm.flown(told)  # who was done meanwhile, or flew legs that others had before, has less left


def _sounded(
    sensor: Sensor, poses: FloatArray, floor: Terrain, noise: float, rng: np.random.Generator, apart_m: float
) -> FloatArray:
    """Return what is sounded from poses (n, 4), shape (m, 4): east, north, depth, deviation."""
    at = poses_apart(poses, apart_m)
    across = np.column_stack([np.cos(at[:, 2]), -np.sin(at[:, 2])])
    found = []
    for angle in BEAMS_RAD[sensor]:
        under = floor.depth_at(at[:, 0], at[:, 1])
        reach = np.tan(angle) * np.maximum(under - at[:, 3], 0.0)
        place = at[:, :2] + reach[:, None] * across
        depth = floor.depth_at(place[:, 0], place[:, 1])
        sd = np.maximum(noise * (depth - at[:, 3]) / np.cos(angle), LEAST_SD_M)
        found.append(np.column_stack([place, depth + rng.normal(size=len(at)) * np.nan_to_num(sd), sd]))
    rows = np.concatenate(found)
    used: FloatArray = rows[np.isfinite(rows).all(axis=1) & (rows[:, 2] > 0)]
    return used
