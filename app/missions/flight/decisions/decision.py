"""One step's decision, from the situation to waypoints that may be sent. Pure apart from the planner's memory."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.coverage import SwathTask
from app.exploration.core.moving_targets import Targets
from app.exploration.core.problem import Belief, Planner, Situation
from app.exploration.site_search import SearchTask
from app.missions.flight.decisions.coming_in import planned_for
from app.missions.flight.decisions.leg import Leg, Place
from app.missions.flight.decisions.shoals import sent_off_shoals
from app.missions.flight.decisions.surfacing import surfacing
from app.missions.safety import travel_depth, waypoint_check
from app.missions.safety.tide_and_bottom import BottomNow, below_surface_m
from app.missions.search.course import hold_before_hazards
from app.missions.spec.mission import MissionSpec
from app.missions.task.planner import turn_radius_m
from app.missions.task.way import RESERVE

RISE_OF_STEP = 0.9
"""Part of a step that a vehicle rises at most, so that a deep one comes up in several steps."""


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
    team, legs, notes = planned_for(places, spec, constraints, knowledge.search is not None)
    belief = knowledge.belief
    # Planners go by what the water leaves them now.
    knowledge = replace(knowledge, belief=belief_below_surface(belief, knowledge.water_level_m))
    floor = BottomNow.of(belief.xy_m, belief.depth_m, belief.sd_m, knowledge.water_level_m)
    if knowledge.search is None:
        team, off, said = sent_off_shoals(team, spec, constraints, floor)
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
        crosslines=spec.coverage.crosslines_pct / 100.0,
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


def _within_step(origin: FloatArray, target: FloatArray, max_step_m: float) -> FloatArray:
    """Shorten a leg horizontally when the change of depth made it longer than a step may be."""
    rise = abs(target[2] - origin[2])
    run = float(np.linalg.norm(target[:2] - origin[:2]))
    if np.hypot(run, rise) <= max_step_m or run == 0.0:
        return target
    factor = np.sqrt(max(max_step_m**2 - rise**2, 0.0)) / run * (1 - 1e-9)
    return np.append(origin[:2] + factor * (target[:2] - origin[:2]), target[2])
