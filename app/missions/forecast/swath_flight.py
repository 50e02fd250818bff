"""A survey with swath sonars flown ahead: its own planner, turning circles, and pings over a floor that is guessed.

Lines follow from what was sounded on the lines before, so what a survey takes depends on how deep its floor is, and how
rough. A vehicle sounds all the way, its turns too, and the next leg is decided a little before it is at the end of its
leg, as at sea.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from shapely.geometry import Polygon

from app.arrays import FloatArray
from app.estimation.swath import SwathSonar
from app.estimation.uncertainty import BeamPaths, Uncertainty, uncertainty
from app.exploration.planners import COVERERS
from app.missions.flight.decisions.decision import Knowledge, decide
from app.missions.flight.legs.demand import LEAD_S, SOON
from app.missions.forecast.floor import Floor
from app.missions.forecast.swarm import FlightOutcome, SoFar, Swarm, WholeSurvey, planner_of, poses_apart
from app.missions.maps.builder import MapBuilder
from app.missions.spec.mission import MissionSpec
from app.missions.task.constraints import limits_of_decisions, make_constraints
from app.missions.task.swath import swath_sonar, swath_task
from app.missions.task.way import least_way_m
from app.missions.team import Member
from simulator.floors.terrain import Terrain

MOST_CELLS = 20_000
"""Cells of such a forecast at most. What a survey ends with are a few of the mission's cells here and there: on larger
ones nothing was missed."""

BEAMS_A_CELL, REACHES = 4.0, 3
"""Beams and pings lie so close together, and where a beam meets the bottom is found in so many steps."""

LEAST_SD_M, LEAST_AVERAGED_M = 0.01, 0.001
IDLE_S = 10.0
"""A vehicle without a line is looked at again after so long: others may have missed something."""

MOST_IDLE = 2
"""Who was so often in a row without a line, while nobody flew one, is done."""


def sweeps(spec: MissionSpec) -> bool:
    """Return whether a mission is a survey with swath sonars, which ends when nothing is left to ensonify."""
    return spec.planner.name in COVERERS and any(swath_sonar(vehicle) is not None for vehicle in spec.vehicles)


def swath_cell_m(spec: MissionSpec) -> float:
    """Return the side of the cells that what is ensonified is counted on."""
    return max(spec.cell_m, math.sqrt(Polygon(spec.local_area()).area / MOST_CELLS))


@dataclass
class Craft:
    """What is known of one vehicle beside its place: its corners, and pings that are still to come in."""

    sonar: SwathSonar | None
    corners_m: list[FloatArray]
    clock_s: list[float]
    position_sd_m: float
    """What it says of how well it knows its place; NaN: it does not say."""
    spacing_m: float
    """How far its pings are apart that are flown ahead,"""
    share: float
    """and which share of those at sea they are."""
    unseen: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))
    """Poses (n, 4): east, north, heading and depth."""
    idle: int = 0


class SwathFlight:
    """Flies one mission ahead over one floor.

    Parameters
    ----------
    starts_m : (vehicles, 2)
    so_far
        What was done of it; of its own soundings one in each cell that is ensonified.
    """

    def __init__(
        self,
        floor: Floor,
        spec: MissionSpec,
        members: list[Member],
        starts_m: FloatArray,
        so_far: SoFar,
    ) -> None:
        self._terrain, self._spec, self._members = floor.terrain, spec, members
        cell_m = swath_cell_m(spec)
        self.builder = MapBuilder(spec.local_area(), cell_m, spec.accuracy_m, cell_of_depth=spec.coverage.cell_of_depth)
        self.builder.arrivals.replace(np.zeros((0, 4)), so_far.prior)
        if len(so_far.soundings):
            east, north, depth, sd = so_far.soundings.T
            self.builder.swath.add_placed(east, north, depth, Uncertainty(sd, np.zeros_like(sd), np.zeros_like(sd)))
        self.builder.build()
        self._cell_m = cell_m
        self._planner = planner_of(spec, so_far)
        self._constraints = limits_of_decisions(make_constraints(spec), self._planner.planner)
        self.swarm = Swarm(spec, members, starts_m, so_far.first_step)
        self._crafts = [
            self._craft(member, start) for member, start in zip(members, np.asarray(starts_m, dtype=float), strict=True)
        ]
        self._rng = np.random.default_rng([spec.seed, 1])
        self._specs = [member.spec for member in members]
        for i in range(len(members)):
            for end in self.swarm.legs_ahead(i):
                self._fly_to(i, end, ahead=True)

    def _craft(self, member: Member, start_m: FloatArray) -> Craft:
        sonar = swath_sonar(member.spec)
        apart_m = self._spec.speed_of(member.spec) / sonar.rate_hz if sonar else math.inf
        spacing_m = max(apart_m, self._cell_m / BEAMS_A_CELL)
        return Craft(sonar, [start_m], [0.0], position_sd_m(member), spacing_m, apart_m / spacing_m)

    @property
    def ways_m(self) -> list[FloatArray]:
        """The ends of everybody's legs, (k, 2) each, from where it began."""
        return [np.array(craft.corners_m) for craft in self._crafts]

    @property
    def clocks_s(self) -> list[FloatArray]:
        """When each was there, (k,) seconds each."""
        return [np.array(craft.clock_s) for craft in self._crafts]

    @property
    def circled_m(self) -> FloatArray:
        """How far each has come, (vehicles,), until the last one is done; who waits for that circles, as at sea."""
        return self.swarm.circled_m(np.array([clock_s[-1] for clock_s in self.clocks_s]))

    def fly(self, over: Callable[[], bool]) -> bool:
        """Fly until nobody has way left or anything to do; return whether that was so before ``over`` was."""
        for craft in self._crafts:
            craft.idle = 0
        while (able := self._able()) and not over():
            first_s = min(float(self.swarm.clock_s[k]) for k in able)
            self._next_legs([k for k in able if self.swarm.clock_s[k] <= first_s + (SOON - 1.0) * LEAD_S])
        self._take_all_in()
        self.builder.build()
        return not able

    def _able(self) -> list[int]:
        return [
            i
            for i, craft in enumerate(self._crafts)
            if craft.sonar is not None and craft.idle < MOST_IDLE and self.swarm.left_m[i] > least_way_m(self._spec)
        ]

    def _next_legs(self, getting: list[int]) -> None:
        """Decide together for vehicles that come to the ends of their legs at the same time, as at sea, and fly."""
        swarm, spec = self.swarm, self._spec
        due = np.zeros(len(self._members), dtype=bool)
        due[getting] = True
        self.builder.build()
        known = Knowledge(
            self.builder.belief(),
            np.zeros((0, 2)),
            swath=swath_task(spec, self._specs, self.builder.coverage()),
        )
        number = int(swarm.legs[getting].max()) + 1
        places = [
            replace(place, at_rest=craft.idle > 0 and place.moving)
            for place, craft in zip(swarm.places(due), self._crafts, strict=True)
        ]
        decision = decide(number, spec, self._constraints, self._planner, places, known)
        target_m = {leg.vehicle: leg.target_m for leg in decision.legs if not leg.refusal}
        for i in getting:
            craft, end = self._crafts[i], target_m.get(self._members[i].name)
            self._take_in(craft)
            if self._members[i].name in decision.done or end is None or swarm.is_there(i, end):
                # Who waits for another one to pass uses up no way: at sea it gets no leg meanwhile.
                craft.idle += 1
                swarm.clock_s[i] += IDLE_S
                continue
            for other in self._crafts:
                other.idle = 0
            self._fly_to(i, end)

    def _fly_to(self, i: int, end: FloatArray, *, ahead: bool = False) -> None:
        swarm, craft = self.swarm, self._crafts[i]
        self._take_in(craft)
        flown = swarm.fly(i, end, ahead=ahead)
        pinged = poses_apart(flown, craft.spacing_m) if craft.sonar else flown[:0]
        late = max(1, math.ceil(LEAD_S * self._spec.speed_of(self._members[i].spec) / craft.spacing_m))
        craft.unseen = pinged[-late:]
        self._ping(craft, pinged[:-late])
        craft.corners_m.append(np.array(end[:2]))
        craft.clock_s.append(float(swarm.clock_s[i]))

    def _take_in(self, craft: Craft) -> None:
        poses, craft.unseen = craft.unseen, np.zeros((0, 4))
        self._ping(craft, poses)

    def _take_all_in(self) -> None:
        for craft in self._crafts:
            self._take_in(craft)

    def _ping(self, craft: Craft, poses: FloatArray) -> None:
        """Sound from poses (n, 4) and take that in."""
        if craft.sonar is None or not len(poses):
            return
        east, north, depth, slant_m, down_m = swath_of(craft.sonar, poses, self._terrain, self._cell_m / BEAMS_A_CELL)
        spec, noise_m = self._spec, np.maximum(self._spec.sounding_noise * slant_m, LEAST_SD_M)
        went = BeamPaths(np.arccos(np.clip(down_m / slant_m, 0.0, 1.0)), down_m, np.zeros_like(down_m))
        sd = uncertainty(went, spec.uncertainty, np.full_like(down_m, craft.position_sd_m))
        # Each beam stands for those beside it that are left out, whose errors average.
        averaged = math.sqrt(min(craft.share * len(depth) / (len(poses) * craft.sonar.beams), 1.0))
        depth = depth + averaged * noise_m * self._rng.standard_normal(len(depth))
        self.builder.swath.add_placed(
            east, north, depth, replace(sd, scattered_sd_m=np.maximum(averaged * sd.scattered_sd_m, LEAST_AVERAGED_M))
        )


def position_sd_m(member: Member) -> float:
    """Return what a vehicle says of how well it knows its place; NaN: it does not say."""
    if member.report is not None and member.report.position_sd_m is not None:
        return member.report.position_sd_m
    # Simulated ones do, before anyone has launched them.
    return 0.0 if member.capabilities.simulated else math.nan


def swath_of(
    sonar: SwathSonar, poses: FloatArray, terrain: Terrain, apart_m: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return what pings from poses (n, 4) meet, (m,) each: east, north, depth, how long the way there is, and how deep.

    ``apart_m`` is how close beams lie on a flat bottom; closer ones are left out.
    """
    under = terrain.depth_at(poses[:, 0], poses[:, 1])
    above_m = np.maximum(under - poses[:, 3], 0.0)
    widest_m = 2.0 * sonar.reach * float(np.nanmax(above_m, initial=0.0))
    beams = int(np.clip(math.ceil(widest_m / apart_m) + 1, 3, sonar.beams)) if widest_m > 0.0 else 1
    slope = np.linspace(-sonar.reach, sonar.reach, beams) if beams > 1 else np.zeros(1)
    starboard = np.column_stack([np.cos(poses[:, 2]), -np.sin(poses[:, 2])])
    down_m = np.repeat(above_m[:, None], beams, axis=1)
    for _ in range(REACHES):
        places = poses[:, None, :2] + (slope * down_m)[..., None] * starboard[:, None]
        depth = terrain.depth_at(places[..., 0], places[..., 1])
        down_m = np.maximum(depth - poses[:, 3, None], 0.0)
    slant_m = down_m * np.hypot(1.0, slope)
    met = np.isfinite(depth) & (depth > 0.0) & (slant_m <= sonar.range_m) & (down_m > 0.0)
    return places[..., 0][met], places[..., 1][met], depth[met], slant_m[met], down_m[met]


def sweep_over(
    floor: Floor,
    spec: MissionSpec,
    members: list[Member],
    starts_m: FloatArray,
    so_far: SoFar,
    budget_s: float,
    stop: Callable[[], bool] = lambda: False,
) -> FlightOutcome:
    """Fly a survey with swath sonars ahead over one floor: for its budget, then on until nothing is left to ensonify.

    After ``budget_s`` seconds of the processor the rest is drawn out from the share that was ensonified by then.
    """
    until = time.thread_time() + budget_s

    def over() -> bool:
        return stop() or time.thread_time() > until

    flight = SwathFlight(floor, spec, members, starts_m, so_far)
    swarm, builder = flight.swarm, flight.builder
    ended = flight.fly(over)
    steps = max(spec.steps - so_far.first_step + 1, 0)
    newest = builder.newest
    done_pct = builder.coverage_pct()
    left_m = swarm.left_m.copy()
    whole = 1.0
    if not ended:
        # As far as it may go, unless all is seen before that.
        goes = float(swarm.distance_m.sum())
        whole = min(1.0 + float(left_m.sum()) / max(goes, 1.0), 100.0 / max(done_pct, 1.0))
    flown = FlightOutcome(
        duration_s=max(float(clock[-1]) for clock in flight.clocks_s) * whole,
        distances_m={
            member.name: float(way_m) * whole for member, way_m in zip(members, flight.circled_m, strict=True)
        },
        coverage_pct=done_pct if ended else min(done_pct * whole, 100.0),
        remaining_pct=builder.remaining_pct() if ended else max(100.0 - done_pct * whole, 0.0),
        mean_sd_m=newest.mean_sd_m if newest is not None else None,
        steps=steps if ended else max(int(swarm.legs.max()) - so_far.first_step + 1, 0),
    )
    swarm.lift_budget()
    all_seen = ended and flight.fly(over)
    share = 1.0 if all_seen else 100.0 / max(builder.coverage_pct(), 1.0)
    return flown.with_whole(
        WholeSurvey(
            ways_m={member.name: way for member, way in zip(members, flight.ways_m, strict=True)},
            clocks_s={member.name: clock for member, clock in zip(members, flight.clocks_s, strict=True)},
            distances_m={member.name: float(swarm.distance_m[i]) for i, member in enumerate(members)},
            drawn_out=share,
            coverage_pct=builder.coverage_pct() if all_seen else 100.0,
            within_budget=ended and bool((left_m > least_way_m(spec)).all()),
        )
    )
