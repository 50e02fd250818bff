"""Plans that vehicles are given, and the requests that start and stop them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import imcpy

from imc_bridge.distances import Place
from imc_bridge.events import Waypoint
from imc_bridge.network.codec import ANY_ENTITY, Message
from imc_bridge.settings import BridgeSettings

FOLLOW, DOWN, THERE, UP, SURFACE = "follow", "down", "there", "up", "surface"
"""Names of the maneuvers."""
DONE = "ManeuverIsDone"
SPEED_METERS_PS = 0
Z_DEPTH = 1
MANEUVER_TIMEOUT_S = 0xFFFF

PLAN_CONTROL_SUCCESS = 1
PLAN_CONTROL_FAILURE = 2
OPERATION_START = 0
OPERATION_STOP = 1

START_RETRY_S = 2.0
"""A start that is not answered is asked for again after so long."""

SLOWEST_SHARE = 0.6
"""A leg may take as long as at this share of the speed asked for."""
CLIMB_MPS = 0.15
"""At the least, when floating up."""
DIVE_MPS = 0.2
"""At the least, with the levelling off, when circling down."""
TURNING_S = 60.0
"""For turning, circling and reporting."""

CIRCLE_RADIUS_M = 10.0
"""The tightest circle that a LAUV flies in an Elevator maneuver, and what is asked for."""
NEARNESS_S = 5.0
"""Goto ends this long before its waypoint, at any depth."""
RUN_UP_M, RUN_PER_DEPTH = 8.0, 5.0
"""What a leg has to be long to reach a depth on the way: for getting under way, and for each metre down."""
SHALLOW_M = 0.5
"""A leg this close to the surface needs neither a descent nor an ascent."""
STATION_RADIUS_M = 15.0
"""Within this distance of its waypoint a vehicle floats up without its motor."""
HOME_RADIUS_M = 10.0
"""Within this distance of its place a vehicle waits at home: the least that a LAUV's StationKeeping takes."""
SURFACE_WAIT_S = 4
"""How long a vehicle that knows itself at the surface waits there before its plan is over: radio needs a moment."""


def follow_plan(settings: BridgeSettings) -> Message:
    """The plan that makes a vehicle follow our references."""
    maneuver = imcpy.FollowReference()
    maneuver.control_src = settings.id
    maneuver.control_ent = ANY_ENTITY
    maneuver.timeout = settings.follow_timeout_s
    maneuver.loiter_radius = settings.loiter_radius_m
    maneuver.altitude_interval = settings.altitude_interval_m
    step = imcpy.PlanManeuver()
    step.maneuver_id = FOLLOW
    step.data = maneuver
    plan = imcpy.PlanSpecification()
    plan.plan_id = settings.plan_id
    plan.start_man_id = FOLLOW
    plan.maneuvers.append(step)
    return plan


def plan_control(operation: int, request_id: int, settings: BridgeSettings, plan: Message | None = None) -> Message:
    """A request to plan control: STOP, or START with a plan, a single maneuver, or by default our FollowReference."""
    request = imcpy.PlanControl()
    request.type = imcpy.PlanControl.TypeEnum.REQUEST
    request.op = imcpy.PlanControl.OperationEnum(operation)
    request.request_id = request_id
    request.plan_id = settings.plan_id
    request.flags = 0
    if operation == OPERATION_START:
        request.arg = plan if plan is not None else follow_plan(settings)
    return request


def goto_plan(plan_id: str, steps: Sequence[tuple[str, Message]]) -> Message:
    """A plan of maneuvers, each with its name, one after the other."""
    plan = imcpy.PlanSpecification()
    plan.plan_id = plan_id
    plan.start_man_id = steps[0][0]
    for name, maneuver in steps:
        step = imcpy.PlanManeuver()
        step.maneuver_id = name
        step.data = maneuver
        plan.maneuvers.append(step)
    for (before, _), (after, _) in itertools.pairwise(steps):
        transition = imcpy.PlanTransition()
        transition.source_man = before
        transition.dest_man = after
        transition.conditions = DONE
        plan.transitions.append(transition)
    return plan


def leg_plan(settings: BridgeSettings, waypoint: Waypoint, depth_m: float, *, descend: bool, aim: Place) -> Message:
    """A plan that leads to a waypoint at a depth and ends at the surface, with no further contact.

    A Goto ends by horizontal nearness alone. So where ``descend`` says that the way is too short for the depth an
    Elevator about the waypoint's circle comes first, which ends at its depth. Up goes the vehicle without its motor,
    in its place; the PopUp after that ends when the vehicle knows itself at the surface, and uses the motor if need be.

    Parameters
    ----------
    settings
    waypoint
    depth_m
    descend
        Whether to circle down first; the waypoint must have a circle then.
    aim
        The place given to the Goto, which ends short of it.
    """
    steps: list[tuple[str, Message]] = []
    if descend:
        steps.append((DOWN, _elevator(waypoint, depth_m)))
    steps.append((THERE, goto_maneuver(waypoint, depth_m, aim)))
    if depth_m > SHALLOW_M:
        steps.append((UP, station_maneuver(waypoint, depth_m)))
    steps.append((SURFACE, _pop_up(waypoint)))
    return goto_plan(settings.plan_id, steps)


def _elevator(waypoint: Waypoint, depth_m: float) -> Message:
    """Circle down to a depth."""
    if waypoint.circle_lat_deg is None or waypoint.circle_lon_deg is None:
        raise ValueError("a waypoint without a circle has no room to descend")
    elevator = imcpy.Elevator()
    elevator.timeout = MANEUVER_TIMEOUT_S
    elevator.flags = 0
    elevator.lat, elevator.lon = math.radians(waypoint.circle_lat_deg), math.radians(waypoint.circle_lon_deg)
    elevator.start_z = elevator.end_z = depth_m
    elevator.start_z_units = elevator.end_z_units = imcpy.ZUnits(Z_DEPTH)
    elevator.radius = CIRCLE_RADIUS_M
    elevator.speed = waypoint.speed_mps
    elevator.speed_units = imcpy.SpeedUnits(SPEED_METERS_PS)
    return elevator


def station_maneuver(waypoint: Waypoint, depth_m: float, radius_m: float = STATION_RADIUS_M) -> Message:
    """Float up at the waypoint from a depth; without one, stay there at the surface for good."""
    station = imcpy.StationKeeping()
    station.lat, station.lon = math.radians(waypoint.lat_deg), math.radians(waypoint.lon_deg)
    station.z, station.z_units = 0.0, imcpy.ZUnits(Z_DEPTH)
    station.radius = radius_m
    station.duration = math.ceil(depth_m / CLIMB_MPS)
    station.speed = waypoint.speed_mps
    station.speed_units = imcpy.SpeedUnits(SPEED_METERS_PS)
    return station


def _pop_up(waypoint: Waypoint) -> Message:
    """Come up here and wait a moment at the surface."""
    bits = imcpy.PopUp.FlagsBits
    up = imcpy.PopUp()
    up.timeout = MANEUVER_TIMEOUT_S
    up.lat, up.lon = math.radians(waypoint.lat_deg), math.radians(waypoint.lon_deg)
    up.z, up.z_units = 0.0, imcpy.ZUnits(Z_DEPTH)
    up.speed = waypoint.speed_mps
    up.speed_units = imcpy.SpeedUnits(SPEED_METERS_PS)
    up.duration = SURFACE_WAIT_S
    up.flags = int(bits.CURR_POS) | int(bits.WAIT_AT_SURFACE) | int(bits.STATION_KEEP)
    return up


def goto_maneuver(waypoint: Waypoint, depth_m: float, aim: Place | None = None) -> Message:
    """A Goto to a waypoint, or to the place it is aimed at, at a depth."""
    lat_deg, lon_deg = aim or (waypoint.lat_deg, waypoint.lon_deg)
    goto = imcpy.Goto()
    goto.timeout = MANEUVER_TIMEOUT_S
    goto.lat = math.radians(lat_deg)
    goto.lon = math.radians(lon_deg)
    goto.z = depth_m
    goto.z_units = imcpy.ZUnits(Z_DEPTH)
    goto.speed = waypoint.speed_mps
    goto.speed_units = imcpy.SpeedUnits(SPEED_METERS_PS)
    # DUNE takes attitudes only where they are finite; these say that none is asked for.
    goto.roll = goto.pitch = goto.yaw = -1.0
    return goto


def descent_m(depth_m: float) -> float:
    """How long a way is on which a vehicle gets from the surface to a depth."""
    return RUN_UP_M + RUN_PER_DEPTH * depth_m if depth_m > SHALLOW_M else 0.0


def leg_time_s(length_m: float, depth_m: float, speed_mps: float, current_mps: float = 0.0) -> float:
    """How long a leg may take until contact returns, were a current of this speed against it all the way."""
    return (
        length_m / (SLOWEST_SHARE * max(speed_mps - current_mps, 0.1))
        + depth_m / DIVE_MPS
        + depth_m / CLIMB_MPS
        + TURNING_S
        + SURFACE_WAIT_S
    )
