"""The planner that a mission asks for, and the circles that its vehicles turn in."""

from app.estimation import Sensor, SingleBeam
from app.exploration.lines.lawnmower import LawnmowerPlanner
from app.exploration.motion.leg_rules import TURN_S
from app.exploration.planner.base import PlannerBase
from app.exploration.planners import create_planner
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleSpec
from app.missions.task.survey_lines import given_lines


def make_planner(spec: MissionSpec, sensor: Sensor | None = None) -> PlannerBase:
    """Return a mission's planner, which pays for turns by the widest circles of its vehicles."""
    widest_m = max((turn_radius_m(spec, vehicle) for vehicle in spec.vehicles), default=TURN_S * spec.speed_mps)
    options = spec.planner.options.model_copy(update={"turn_radius_m": widest_m})
    planner = create_planner(spec.planner.name, options, SingleBeam() if sensor is None else sensor)
    if spec.survey_lines and isinstance(planner, LawnmowerPlanner):
        planner.take_lines(given_lines(spec))
    return planner


def turn_radius_m(spec: MissionSpec, vehicle: VehicleSpec) -> float:
    """Return the radius of the circles that a vehicle turns in: as it is declared, or as the planner's options say."""
    if vehicle.turn_radius_m is not None:
        return vehicle.turn_radius_m
    return spec.planner.options.turn_radius_m or TURN_S * spec.speed_of(vehicle)
