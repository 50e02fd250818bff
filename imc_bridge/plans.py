"""Plans that vehicles are given, and the requests that start and stop them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import imcpy

from imc_bridge.codec import ANY_ENTITY, Message
from imc_bridge.events import Waypoint
from imc_bridge.settings import BridgeSettings

FOLLOW, THERE, UP = "follow", "there", "up"
"""Names of the maneuvers."""
DONE = "ManeuverIsDone"
SPEED_METERS_PS = 0
Z_DEPTH = 1
MANEUVER_TIMEOUT_S = 0xFFFF

PLAN_CONTROL_SUCCESS = 1
PLAN_CONTROL_FAILURE = 2
OPERATION_START = 0
OPERATION_STOP = 1

SLOWEST_SHARE = 0.6
"""A leg may take as long as at this share of the speed asked for."""
CLIMB_MPS = 0.15
"""At the least, when floating up."""
TURNING_S = 45.0
"""For turning, diving and reporting."""


def follow_plan(settings: BridgeSettings) -> Message:
    """The plan that makes a vehicle follow our references."""
    maneuver = imcpy.FollowReference()
    maneuver.control_src = settings.imc_id
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


def leg_plan(settings: BridgeSettings, waypoint: Waypoint, depth_m: float) -> Message:
    """A plan that leads to a waypoint at a depth and then up to the surface, with no further contact."""
    return goto_plan(
        settings.plan_id, [(name, goto_maneuver(waypoint, depth)) for name, depth in ((THERE, depth_m), (UP, 0.0))]
    )


def goto_maneuver(waypoint: Waypoint, depth_m: float) -> Message:
    """A Goto to a waypoint at a depth."""
    goto = imcpy.Goto()
    goto.timeout = MANEUVER_TIMEOUT_S
    goto.lat = math.radians(waypoint.lat_deg)
    goto.lon = math.radians(waypoint.lon_deg)
    goto.z = depth_m
    goto.z_units = imcpy.ZUnits(Z_DEPTH)
    goto.speed = waypoint.speed_mps
    goto.speed_units = imcpy.SpeedUnits(SPEED_METERS_PS)
    # DUNE takes attitudes only where they are finite; these say that none is asked for.
    goto.roll = goto.pitch = goto.yaw = -1.0
    return goto


def leg_time_s(length_m: float, depth_m: float, speed_mps: float) -> float:
    """How long a leg may take until the vehicle is heard again."""
    return length_m / (SLOWEST_SHARE * max(speed_mps, 0.1)) + depth_m / CLIMB_MPS + TURNING_S
