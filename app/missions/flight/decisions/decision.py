"""One step's decision, from the situation to waypoints that may be sent. Pure apart from the planner's memory."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
import shapely
from shapely.geometry import Point, Polygon

from app.arrays import BoolArray, FloatArray
from app.estimation import Sensor, SingleBeam
from app.estimation.swath import SwathSonar
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.coverage import Coverage, SwathTask
from app.exploration.core.errands import due_to_rise
from app.exploration.core.moving_targets import Localization, Targets
from app.exploration.core.open_ground import OpenGround
from app.exploration.core.problem import Belief, Planner, Situation
from app.exploration.planner.base import PlannerBase
from app.exploration.planners import create_planner
from app.exploration.site_search import SearchTask
from app.missions.flight.decisions.zone_clearance import clear_of_zones, room_around
from app.missions.safety import free_space, travel_depth, waypoint_check
from app.missions.safety.tide_and_bottom import BottomNow, below_surface_m
from app.missions.safety.way_off_shoals import way_off
from app.missions.search.course import hold_before_hazards
from app.missions.spec.mission import MissionSpec
from app.missions.spec.surface_policy import SurfacePolicy
from app.missions.spec.swath import SwathSonarSpec
from app.missions.spec.vehicle import Sensor as SensorName
from app.missions.spec.vehicle import VehicleSpec

REACTS_WITHIN_M = 0.5
"""So far a vehicle goes on past the radius in which it arrives until its next leg is sent."""

NEARBY_OUTSIDE_M = 10.0
"""A vehicle that drifted or overshot this little is planned for as if it were at the border."""

RESERVE = 0.06
"""Share of the remaining steps that a planner is not told of: vehicles turn in circles and pass waypoints at the side,
so a plan that needs every step would end with its last line half flown. What is not used is released bit by bit."""

TURN_S = 4.0
"""A vehicle whose turning circle nobody knows turns in one whose radius it flies in so many seconds."""

RISE_AT = 0.9
"""Part of the allowed deviation at which a vehicle comes up: the rest is for the way to the surface."""

RISE_OF_STEP = 0.9
"""Part of a step that a vehicle rises at most, so that a deep one comes up in several steps."""

POND = 2.0
"""Who is cut off by shoals on less ground than a square of so many steps leaves it: little can be flown there."""

INSET_M = 1.0
"""Vehicles that come from outside are sent to a point this far inside the border."""


@dataclass(frozen=True)
class Place:
    """Where one vehicle's next leg begins, and the depth it should travel at."""

    vehicle: str
    en_m: FloatArray
    heading_rad: float
    cruise_depth_m: float
    position_sd_m: float = math.nan
    """How well it says that it knows where it is; NaN: it does not say."""
    surfacing_depth_m: float = math.nan
    """Its depth, when its last waypoint brought it up for a fix; NaN when not."""
    keeps_depth: bool = False
    """Whether it travels at the depth that its mission began with, whatever it is told."""
    moving: bool = True
    """Whether it gets a leg now; where not, it has enough of them and ``en_m`` is where they end."""
    left_m: float = math.nan
    """How far it may still fly; NaN: as many steps as the mission has left."""
    submerged_s: float = 0.0
    """How long it has been under water since its last fix at the surface, by its clock."""
    altitude_m: float = math.nan
    """Height above the bottom that it is to keep; NaN: it keeps its depth."""
    turn_radius_m: float = 0.0
    """Of its turning circle."""
    at_rest: bool = False
    """Whether it flew all its legs so long ago that what it measured there is known."""

    @property
    def surfacing(self) -> bool:
        """Whether its last waypoint brought it up for a fix."""
        return math.isfinite(self.surfacing_depth_m)

    def travel_depth_m(
        self, origin_m: FloatArray, target_m: FloatArray, bottom: Bottom, constraints: Constraints
    ) -> float:
        """Return how deep it travels from one place (2,) to another over a pessimistic sea floor.

        Where it ends it may rise over whatever is known within its next leg, wherever that goes.
        """
        least_m = constraints.min_altitude_m
        if self.keeps_depth:
            return travel_depth.travel_depth_m(origin_m, target_m, self.cruise_depth_m, bottom, least_m)
        if math.isnan(self.altitude_m):
            depth_m = travel_depth.travel_depth_m(origin_m, target_m, self.cruise_depth_m, bottom, least_m)
        else:
            depth_m = travel_depth.depth_above_bottom_m(
                origin_m, target_m, self.altitude_m, self.cruise_depth_m, bottom, constraints, self.turn_radius_m
            )
        to_leave_m = bottom.deepest_to_leave_m(target_m, least_m, constraints.climb, constraints.max_step_m)
        return min(depth_m, max(to_leave_m, 0.0))


@dataclass(frozen=True)
class Leg:
    """Where one vehicle is sent, or why it is not sent anywhere."""

    vehicle: str
    target_m: FloatArray
    refusal: str = ""
    surfacing: bool = False
    """Whether it comes up, or stays up, for a fix."""
    unplanned: bool = False
    """Whether it leads to where a vehicle can be planned for, into the area from far outside or off a shoal: where
    ways are counted it takes nothing of the one that is to be flown."""


@dataclass(frozen=True)
class Decision:
    """A step's waypoints, the planner's figures, and what the operator has to know.

    ``bottom`` is the pessimistic sea floor that the depths of travel were chosen by, below the surface as it is now.
    """

    legs: list[Leg]
    objective: float | None
    terms: dict[str, float]
    memory: bytes
    notes: list[str] = field(default_factory=list)
    fixes: dict[str, str] = field(default_factory=dict)
    """Vehicles that begin or end coming up for a fix, with what there is to say."""
    bottom: Bottom = field(default_factory=Bottom.unknown)
    pursuits: dict[str, str] = field(default_factory=dict)
    """Vehicles that leave the mapping for a target, with its name."""
    origin_m: dict[str, FloatArray] = field(default_factory=dict)
    """Where every vehicle was, (2,)."""
    done: frozenset[str] = frozenset()
    """Vehicles that would get a leg, and for which nothing is left to do as things stand."""


@dataclass(frozen=True)
class Knowledge:
    """What a mission knows when a step is decided."""

    belief: Belief
    """Its map."""
    soundings_en_m: FloatArray
    """Where it sounded, (n, 2)."""
    water_level_m: float = 0.0
    """How high the water stands above the datum of the belief's depths.

    Vehicles count their depth from the water level: below the datum it leaves them less room; above it the room to
    spare is not used.
    """
    doubtful_en_m: FloatArray | None = None
    """Where the map left soundings out as outliers, (k, 2); None: nowhere."""
    targets: Targets | None = None
    """The mission's, in the order of its description."""
    search: SearchTask | None = None
    """What a search knows of its site."""
    swath: SwathTask | None = None
    """What there is to ensonify, in a survey that plans by that."""


def make_constraints(spec: MissionSpec) -> Constraints:
    """Return a mission's limits in its local frame."""
    limits = spec.limits
    zones = [spec.to_local(zone) for zone in spec.keep_out]
    margins = [free_space.widened(zone, limits.keep_out_margin_m) for zone in zones if limits.keep_out_margin_m > 0]
    area = spec.local_inner_area()
    # A search keeps off everything by more than a vehicle's arrival radius.
    room_m = arrival_room_m(spec) if spec.search is None else 0.0
    return Constraints(
        area=area,
        # A vehicle that came too near by turning may leave the margin by any way but one through the zone itself.
        keep_out=(*zones, *margins),
        around=room_around(area, margins or zones, room_m),
        max_step_m=limits.max_step_m,
        # Depths are chosen here and may be shallower than asked where the water is; see travel_depth.travel_depth_m.
        min_depth_m=0.0,
        max_depth_m=limits.max_depth_m,
        min_altitude_m=limits.min_altitude_m,
        com_range_m=limits.com_range_m if limits.com_range_m is not None else np.inf,
        min_separation_m=limits.min_separation_m,
        min_vertical_separation_m=limits.min_vertical_separation_m,
        climb=travel_depth.RISE,
    )


def arrival_room_m(spec: MissionSpec) -> float:
    """Return how far at most a vehicle is from where its leg ends when it begins the next one."""
    return spec.arrival_radius_m + REACTS_WITHIN_M


def turn_radius_m(spec: MissionSpec, vehicle: VehicleSpec) -> float:
    """Return the radius of the circles that a vehicle turns in: as it is declared, or as the planner's options say."""
    if vehicle.turn_radius_m is not None:
        return vehicle.turn_radius_m
    return spec.planner.options.turn_radius_m or TURN_S * spec.speed_of(vehicle)


def make_planner(spec: MissionSpec, sensor: Sensor | None = None) -> PlannerBase:
    """Return a mission's planner, which pays for turns by the widest circles of its vehicles."""
    widest_m = max((turn_radius_m(spec, vehicle) for vehicle in spec.vehicles), default=TURN_S * spec.speed_mps)
    options = spec.planner.options.model_copy(update={"turn_radius_m": widest_m})
    return create_planner(spec.planner.name, options, SingleBeam() if sensor is None else sensor)


def swath_task(spec: MissionSpec, vehicles: Iterable[VehicleSpec], coverage: Coverage) -> SwathTask:
    """Return what the swath sonars of a mission's vehicles have to ensonify: the area but for its keep-out zones."""
    team = list(vehicles)
    coverage = without_zones(spec, coverage)
    sonars = {vehicle.name: sonar for vehicle in team if (sonar := swath_sonar(vehicle)) is not None}
    altitudes_m = {vehicle.name: vehicle.altitude_m for vehicle in team if vehicle.altitude_m is not None}
    asked = spec.coverage
    return SwathTask(coverage, sonars, asked.overlap_pct / 100.0, asked.crosslines_pct / 100.0, altitudes_m)


def limits_of_decisions(constraints: Constraints, planner: PlannerBase) -> Constraints:
    """Return the limits that legs are decided by where every vehicle flies its own.

    Lines are as they are: whether vehicles meet on them is looked at in time, leg by leg. A vehicle at the end of its
    last leg is in nobody's way for good.
    """
    return replace(constraints, min_separation_m=0.0) if planner.flies_lines else constraints


def without_zones(spec: MissionSpec, coverage: Coverage) -> Coverage:
    """Return what there is to ensonify without a mission's keep-out zones."""
    if not spec.keep_out:
        return coverage
    zones = tuple(spec.to_local(zone).tobytes() for zone in spec.keep_out)
    inside = _cells_in(zones, coverage.west_m, coverage.south_m, coverage.cell_m, *coverage.wanted.shape)
    return replace(coverage, wanted=coverage.wanted & ~inside)


@lru_cache(maxsize=32)
def _cells_in(
    zones: tuple[bytes, ...], west_m: float, south_m: float, cell_m: float, rows: int, cols: int
) -> BoolArray:
    east_m, north_m = np.meshgrid(west_m + (np.arange(cols) + 0.5) * cell_m, south_m + (np.arange(rows) + 0.5) * cell_m)
    inside = np.zeros((rows, cols), dtype=bool)
    # Their corners are bytes, so that what was found for them is found again.
    for corners in zones:
        inside |= shapely.contains_xy(Polygon(np.frombuffer(corners).reshape(-1, 2)), east_m, north_m)
    return inside


def swath_sonar(vehicle: VehicleSpec) -> SwathSonar | None:
    """Return the swath sonar of a vehicle; None where it has none."""
    if vehicle.sensor is not SensorName.MULTIBEAM:
        return None
    sonar = vehicle.sonar or SwathSonarSpec()
    return SwathSonar(math.radians(sonar.aperture_deg), sonar.beams, sonar.rate_hz, sonar.range_m, equidistant=False)


def planned_way_m(spec: MissionSpec, left_m: float) -> float:
    """Return how much of the way that a vehicle has left is planned for, metres.

    Where legs are counted, those that end at a corner are shorter than a step, and count all the same.
    """
    if spec.budget.steps is None:
        return left_m
    return max((1.0 - RESERVE) * left_m, min(left_m, spec.limits.max_step_m))


def decide(
    step: int,
    spec: MissionSpec,
    constraints: Constraints,
    planner: Planner,
    places: list[Place],
    knowledge: Knowledge,
    attempt: int = 0,
) -> Decision:
    """Decide one step for the vehicles at ``places``; vehicles far outside the area are sent to its border.

    ``attempt``: how often the same legs were decided and not flown; chance then falls out otherwise.
    """
    where = {place.vehicle: place.en_m for place in places}
    team, legs, notes = _planned_for(places, spec, constraints, knowledge.search is not None)
    belief = knowledge.belief
    # Planners go by what the water leaves them now.
    knowledge = replace(knowledge, belief=belief_below_surface(belief, knowledge.water_level_m))
    floor = BottomNow.of(belief.xy_m, belief.depth_m, belief.sd_m, knowledge.water_level_m)
    if knowledge.search is None:
        team, off, said = _sent_off_shoals(team, spec, constraints, floor)
        legs, notes = [*legs, *off], [*notes, *said]
    if not team:
        return Decision(legs, None, {}, planner.snapshot(), notes, bottom=floor.cautious, origin_m=where)

    origin = np.array([[*p.en_m, p.travel_depth_m(p.en_m, p.en_m, floor.cautious, constraints)] for p in team])
    up, fixes = surfacing(team, spec.surface_policy)
    for i, place in enumerate(team):
        if place.surfacing:
            origin[i, 2] = min(origin[i, 2], max(place.surfacing_depth_m, 0.0))
    situation = _situation(step, spec, constraints, team, origin, knowledge)
    proposal = planner.propose(situation, np.random.default_rng([spec.seed, step, *([attempt] if attempt else [])]))
    moving = np.array([p.moving for p in team])
    proposed = np.where(moving[:, None], np.array(proposal.positions, dtype=float), origin)
    for i, place in enumerate(team):
        if place.moving and np.isfinite(proposed[i]).all():  # else the check makes the vehicle hold
            proposed[i] = _flyable(place, origin[i], proposed[i], up[i], floor, constraints)
    if knowledge.search is not None:
        proposed, held = hold_before_hazards(knowledge.search, situation.vehicles, origin, proposed)
        notes += held
    for i, place in enumerate(team):
        start = where[place.vehicle]
        if not place.moving or np.array_equal(start, place.en_m) or not np.isfinite(proposed[i]).all():
            continue
        # It was planned for from the border, and comes from beyond it: no farther than there where both is too far.
        if np.linalg.norm(proposed[i, :2] - start) > constraints.max_step_m:
            proposed[i] = origin[i]
        depth_m = place.travel_depth_m(start, proposed[i, :2], floor.cautious, constraints)
        proposed[i, 2] = min(proposed[i, 2], depth_m)
    checked = waypoint_check.check_step(situation.vehicles, origin, proposed, constraints, floor.likely)
    resting = {place.vehicle for place in team if not place.moving or place.vehicle in proposal.done}
    told = (checked.corrections | checked.refusals).items()
    notes += [f"{name}: {reason}" for name, reason in told if name not in resting]
    for i, place in enumerate(team):
        if place.vehicle in resting:
            continue
        refusal = checked.refusals.get(place.vehicle, "")
        if not refusal and place.keeps_depth:
            refusal = travel_depth.too_deep(place.cruise_depth_m, float(checked.positions[i, 2]))
            notes += [f"{place.vehicle}: {refusal}"] if refusal else []
        legs.append(Leg(place.vehicle, checked.positions[i], refusal, bool(up[i])))
    pursuits = {name: spec.targets[number].name for name, number in proposal.errands.items() if number >= 0}
    return Decision(
        legs,
        proposal.objective,
        dict(proposal.terms),
        planner.snapshot(),
        notes=notes,
        fixes=fixes,
        bottom=floor.cautious,
        pursuits=pursuits,
        origin_m=where,
        done=frozenset(place.vehicle for place in team if place.moving and place.vehicle in proposal.done),
    )


def belief_below_surface(belief: Belief, water_level_m: float) -> Belief:
    """Return a map whose depths are told from the surface as it is now, as vehicles count theirs."""
    depth_m = below_surface_m(belief.depth_m, water_level_m)
    sounded_m = belief.sounded_m.copy()
    sounded_m[:, 2] = below_surface_m(sounded_m[:, 2], water_level_m)
    return replace(belief, depth_m=depth_m, sounded_m=sounded_m)


def _planned_for(
    places: list[Place], spec: MissionSpec, constraints: Constraints, site_unknown: bool
) -> tuple[list[Place], list[Leg], list[str]]:
    """Return whom the planner plans for, the legs of those that come in from far outside, and what is to be said.

    Who is a little outside is planned for from the border, and who waits too near to a zone is taken to wait beside it.
    Nobody is sent over what a search does not know.
    """
    polygon = Polygon(constraints.area)
    notes: list[str] = []
    team: list[Place] = []
    legs: list[Leg] = []
    for place in places:
        outside_m = free_space.distance_outside_m(polygon, place.en_m)
        border = free_space.nearest_inside(polygon, place.en_m)
        # No leg may end in a zone's margin: who is beyond one at the border is planned for from beside it.
        begins = clear_of_zones(constraints, border) if outside_m > 0.0 else place.en_m
        # Who is beyond a zone at the border is not planned for as if it were there.
        cut_off = outside_m > arrival_room_m(spec) and free_space.barred(constraints, place.en_m, border)
        if outside_m > 0.0 and not np.array_equal(begins, border):
            cut_off |= math.dist(place.en_m, begins) > constraints.max_step_m
        far = cut_off or from_outside(place.en_m, polygon, spec)
        if far and not place.moving:
            continue
        if far and site_unknown:
            refusal = (
                f"it is {outside_m:.0f} m outside the site, and what lies between is not known: bring it to the entry"
            )
            notes.append(f"{place.vehicle}: {refusal}")
            legs.append(Leg(place.vehicle, np.append(place.en_m, 0.0), refusal))
        elif far:
            others = [p.en_m for p in places if p is not place] + [other.target_m[:2] for other in legs]
            leg = _come_in(place, constraints, others, arrival_room_m(spec))
            inside = polygon.contains(Point(leg.target_m[:2]))
            what = leg.refusal or ("it is sent to the border" if inside else "it is sent round a keep-out zone")
            notes.append(f"{place.vehicle} is {outside_m:.0f} m outside the area: {what}")
            legs.append(leg)
        else:
            # Nobody may stay where a limit is broken: who gets no leg there would keep all others from theirs.
            team.append(replace(place, en_m=begins if place.moving else clear_of_zones(constraints, begins)))
    return team, legs, notes


def _sent_off_shoals(
    team: list[Place], spec: MissionSpec, constraints: Constraints, floor: BottomNow
) -> tuple[list[Place], list[Leg], list[str]]:
    """Return the vehicles as they are planned for, the legs of those that shoals cut off, and what is to be said.

    A planner finds no way off a shoal: each begins over ground that it may not go over. It plans for the others as if
    who is there had left already, for that one would keep all of them from their legs.
    """
    ground = OpenGround(floor.likely, constraints)
    planned: list[Place] = []
    legs: list[Leg] = []
    notes: list[str] = []
    for place in team:
        if place.keeps_depth or not ground.is_cut_off(place.en_m, (POND * constraints.max_step_m) ** 2):
            planned.append(place)
            continue
        others = (
            [p.en_m for p in team if p is not place] + [p.en_m for p in planned] + [leg.target_m[:2] for leg in legs]
        )
        goal = way_off(place.en_m, ground, floor.likely, constraints, others, arrival_room_m(spec))
        # Its lines stay its own.
        planned.append(replace(place, en_m=ground.nearest_m(place.en_m) if goal is None else goal, moving=False))
        if not place.moving:
            continue
        depth_m, least_m = float(floor.likely.at(place.en_m)), constraints.min_altitude_m
        where = f"the bottom is {depth_m:.1f} m below the surface there, and {least_m:g} m are needed"
        if depth_m >= least_m:
            where = "shoals cut it off there"
        refusal = "" if goal is not None else f"{where}; every way off leads over dry ground or is barred"
        end_m = place.en_m if goal is None else goal
        legs.append(Leg(place.vehicle, np.append(end_m, 0.0), refusal, unplanned=True))
        notes.append(f"{place.vehicle}: {refusal or f'{where}; it leaves for deeper ground at the surface'}")
    return planned, legs, notes


def from_outside(place_m: FloatArray, area: Polygon, spec: MissionSpec) -> bool:
    """Return whether a vehicle is so far outside the area, without its margin, that it is sent to its border first."""
    return free_space.distance_outside_m(area, place_m) > NEARBY_OUTSIDE_M + spec.limits.border_margin_m


def _situation(
    step: int,
    spec: MissionSpec,
    constraints: Constraints,
    team: list[Place],
    origin: FloatArray,
    knowledge: Knowledge,
) -> Situation:
    """Return what the planner is asked about vehicles that are at ``origin``, (n, 3)."""
    moving = np.array([p.moving for p in team])
    left_m = np.array([p.left_m for p in team])
    radii_m = {vehicle.name: turn_radius_m(spec, vehicle) for vehicle in spec.vehicles}
    doubtful_en_m = knowledge.doubtful_en_m
    return Situation(
        step=step,
        steps_total=step - 1 + math.ceil((1 - RESERVE) * (spec.steps - step + 1)),
        vehicles=tuple(place.vehicle for place in team),
        positions=origin,
        headings_rad=np.array([p.heading_rad for p in team]),
        belief=knowledge.belief,
        soundings_en_m=knowledge.soundings_en_m,
        constraints=constraints.for_plans,
        doubtful_en_m=np.zeros((0, 2)) if doubtful_en_m is None else doubtful_en_m,
        targets=knowledge.targets,
        search=knowledge.search,
        moving=None if moving.all() else moving,
        left_m=None if np.isnan(left_m).any() else left_m,
        turns_take_way=spec.budget.minutes is not None,
        turn_radii_m=np.array([radii_m.get(place.vehicle, place.turn_radius_m) for place in team]),
        swath=knowledge.swath,
        at_rest=frozenset(place.vehicle for place in team if place.at_rest),
    )


def _flyable(
    place: Place, origin: FloatArray, proposed: FloatArray, rises: bool, floor: BottomNow, constraints: Constraints
) -> FloatArray:
    """Return where a vehicle is sent instead of a proposed position (3,): in its depth, its step, and its way left."""
    target = proposed.copy()
    target[2] = place.travel_depth_m(place.en_m, target[:2], floor.cautious, constraints)
    leg_m, least_m = target[:2] - origin[:2], constraints.min_altitude_m
    clear_m = floor.likely.deepest_end_m(origin, leg_m, least_m, constraints.climb)
    target[2] = min(target[2], max(float(clear_m), 0.0))
    if rises:
        # It goes on along its leg while it rises; the checks below are the same for it as for everyone.
        target[2] = min(target[2], max(origin[2] - RISE_OF_STEP * constraints.max_step_m, 0.0))
    target = _within_step(origin, target, constraints.max_step_m)
    length_m = float(np.linalg.norm(target[:2] - origin[:2]))
    if length_m > place.left_m:
        target[:2] = origin[:2] + place.left_m / length_m * (target[:2] - origin[:2])
    return target


def surfacing(team: list[Place], policy: SurfacePolicy | None) -> tuple[list[bool], dict[str, str]]:
    """Return which vehicles come up or stay up for a fix, and what is to be said of those that begin or end it.

    A vehicle that does not say how well it knows where it is comes up by the clock only.
    """
    if policy is None:
        return [False] * len(team), {}
    sd = np.array([place.position_sd_m for place in team])
    limit_m = math.inf if policy.max_position_sd_m is None else policy.max_position_sd_m
    every_s = math.inf if policy.every_min is None else 60.0 * policy.every_min
    due = due_to_rise(Localization(sd, sd / RISE_AT, limit_m))
    up: list[bool] = []
    told: dict[str, str] = {}
    for place, late in zip(team, due, strict=True):
        if not place.moving:
            up.append(False)
            continue
        by_clock = place.submerged_s >= every_s
        # Who says no more how well it knows where it is stays up, unless the clock sees to that.
        says = math.isfinite(place.position_sd_m) or policy.every_min is None
        poor = policy.max_position_sd_m is not None and says and not place.position_sd_m <= policy.until_sd_m
        stays = place.surfacing and (by_clock or poor)
        up.append(bool(late or by_clock or stays))
        if by_clock and not late and not place.surfacing:
            told[place.vehicle] = (
                f"{place.vehicle} comes up for a fix: it was under water for {place.submerged_s / 60:.0f} min"
            )
        elif up[-1] and not place.surfacing:
            told[place.vehicle] = (
                f"{place.vehicle} comes up for a fix: it knows its position to {place.position_sd_m:.2g} m, "
                f"{policy.max_position_sd_m:g} m are allowed"
            )
        elif place.surfacing and not up[-1]:
            knows = f": it knows its position to {place.position_sd_m:.2g} m"
            told[place.vehicle] = (
                f"{place.vehicle} goes down again{knows if math.isfinite(place.position_sd_m) else ''}"
            )
    return up, told


def _come_in(place: Place, constraints: Constraints, taken: list[FloatArray], room_m: float) -> Leg:
    """Send a vehicle that is far outside to the area's border, clear of keep-out zones and of others (n of (2,)).

    Where no straight way leads there it is sent to the first corner of a way round zones, ``room_m`` from them.
    """
    goal = free_space.way_in(constraints, place.en_m, INSET_M, taken, room_m)
    if goal is None:
        return Leg(place.vehicle, np.append(place.en_m, 0.0), "a keep-out zone or a vehicle bars every way in")
    # The bottom on the way is unknown: it comes at the surface.
    return Leg(place.vehicle, np.append(goal, 0.0), unplanned=True)


def _within_step(origin: FloatArray, target: FloatArray, max_step_m: float) -> FloatArray:
    """Shorten a leg horizontally when the change of depth made it longer than a step may be."""
    rise = abs(target[2] - origin[2])
    run = float(np.linalg.norm(target[:2] - origin[:2]))
    if np.hypot(run, rise) <= max_step_m or run == 0.0:
        return target
    factor = np.sqrt(max(max_step_m**2 - rise**2, 0.0)) / run * (1 - 1e-9)
    return np.append(origin[:2] + factor * (target[:2] - origin[:2]), target[2])
