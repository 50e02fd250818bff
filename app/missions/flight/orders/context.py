"""What orders of one flight are checked by, and carried out with."""

from dataclasses import dataclass

from app.exploration.core.constraints import Constraints
from app.exploration.planner.ordered import OrderedPlanner
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.flight.legs.energy_range import EnergyRange


@dataclass(frozen=True)
class OrderContext:
    """The parts of a flight that its orders need."""

    planner: OrderedPlanner
    constraints: Constraints
    energy_range: EnergyRange
    dispatch: Dispatch
    apart: bool
    """Whether vehicles have legs of their own: only then one can be sent elsewhere alone."""
