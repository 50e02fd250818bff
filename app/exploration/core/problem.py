"""What a planner is asked and what it answers.

All positions are metres in one local Cartesian frame: columns ``east_m, north_m, depth_m`` (depth positive down).
Arrays are never modified by the receiver.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.coverage import SwathTask
from app.exploration.core.moving_targets import Localization, Targets
from app.exploration.core.search_task import SearchTask


@dataclass(frozen=True)
class Belief:
    """What is known of the sea floor, at fixed landmarks (the nodes of the map's grid in a bathymeter mission).

    Attributes
    ----------
    xy_m : (n_landmarks, 2)
        Fixed horizontal positions, east and north.
    depth_m : (n_landmarks,)
        Current depth estimates; NaN where nothing is known at all.
    sd_m : (n_landmarks,)
        Their standard deviations (the confidence ``c_L`` is the square); inf where nothing is known.
    accurate : (n_landmarks,)
        The set ``A``: landmarks whose estimate once passed the accuracy threshold.
    weight : (n_landmarks,)
        How much each landmark matters: local roughness of the sea floor relative to the area's mean, mean about 1.
    correlation_length_m : float
        Distance over which a sounding informs its surroundings.
    covariance_m2 : (n_landmarks, 3, 3) or None
        Where whole positions are estimated, their covariances; ``xy_m`` are then estimates too, presumed places for
        landmarks never seen, and ``sd_m`` the deviation along the worst direction. None: only depths are estimated.
    on_floor : bool
        Whether landmarks lie on the sea floor, so that vehicles have to keep above them.
    complete : bool
        Whether everything that vehicles have seen is in it, so that what it lacks was not seen; no where messages are
        limited.
    sounded_m : (k, 3)
        East, north and depth where altimeters found the sea floor under vehicles, where landmarks are not seen from
        straight above; empty where ``depth_m`` tells all that is known.
    """

    xy_m: FloatArray
    depth_m: FloatArray
    sd_m: FloatArray
    accurate: BoolArray
    weight: FloatArray
    correlation_length_m: float
    covariance_m2: FloatArray | None = None
    on_floor: bool = True
    complete: bool = True
    sounded_m: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True)
class Situation:
    """Everything a planner may know when it decides one step.

    Attributes
    ----------
    step : int
        Number of the step being decided, from 1.
    steps_total : int
        Steps of the whole mission, this one included in the count.
    vehicles : tuple of str
        Names, in the order of the rows of ``positions``; may change from step to step.
    positions : (n_vehicles, 3)
        The team configuration ``X_R``: where the vehicles are when the step begins.
    headings_rad : (n_vehicles,)
        Clockwise from north; NaN where unknown.
    belief : Belief
        What is known of the sea floor.
    soundings_en_m : (n_soundings, 2)
        Where soundings were taken so far that the map is made of.
    constraints : Constraints
        What every proposed configuration must obey.
    targets : Targets or None
        What is known of moving targets, where there are any.
    localization : Localization or None
        How well the vehicles know where they are; None: well enough.
    doubtful_en_m : (k, 2)
        Soundings that the map leaves out because their neighbours contradict them: a fish, or a rock.
    search : SearchTask or None
        What a search mission is about; the belief then says nothing.
    moving : (n_vehicles,) or None
        Which vehicles get a leg now; None: all. The others have enough legs: their rows of ``positions`` are where the
        last of these ends, and a proposal leaves them there.
    left_m : (n_vehicles,) or None
        How far each may still fly from its position; None: the remaining steps, each as long as a step may be.
    turns_take_way : bool
        Whether turns take some of that, as where time is counted; not where legs are, or their metres.
    turn_radii_m : (n_vehicles,) or None
        Of each vehicle's turning circle; None: as the planner's options say.
    swath : SwathTask or None
        What is to be ensonified, in a survey with swath sonars.
    crosslines : float
        Length of lines across all others that are asked for, as a share of those.
    at_rest : frozenset of str
        Vehicles that flew all their legs so long ago that what they measured there is known.
    """

    step: int
    steps_total: int
    vehicles: tuple[str, ...]
    positions: FloatArray
    headings_rad: FloatArray
    belief: Belief
    soundings_en_m: FloatArray
    constraints: Constraints
    targets: Targets | None = None
    localization: Localization | None = None
    doubtful_en_m: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    search: SearchTask | None = None
    moving: BoolArray | None = None
    left_m: FloatArray | None = None
    turns_take_way: bool = True
    turn_radii_m: FloatArray | None = None
    swath: SwathTask | None = None
    crosslines: float = 0.0
    at_rest: frozenset[str] = frozenset()

    @property
    def moves(self) -> BoolArray:
        """Which vehicles get a leg now, (n_vehicles,)."""
        return np.ones(len(self.vehicles), dtype=np.bool_) if self.moving is None else self.moving

    def of(self, rows: IntArray) -> "Situation":
        """Return the situation of some of the vehicles only, in the order of ``rows``."""
        return replace(
            self,
            vehicles=tuple(self.vehicles[i] for i in rows),
            positions=np.asarray(self.positions, dtype=np.float64)[rows],
            headings_rad=np.asarray(self.headings_rad, dtype=np.float64)[rows],
            localization=None if self.localization is None else self.localization.of(rows),
            moving=None if self.moving is None else self.moving[rows],
            left_m=None if self.left_m is None else self.left_m[rows],
            turn_radii_m=None if self.turn_radii_m is None else self.turn_radii_m[rows],
        )


@dataclass(frozen=True)
class Proposal:
    """A planner's answer: the next team configuration, (n_vehicles, 3), and figures for the operator.

    ``errands`` names vehicles that left the plan, with the number of their target; negative: the surface.
    ``done`` names vehicles for which nothing is left to do as things stand; they hold.
    """

    positions: FloatArray
    objective: float
    terms: dict[str, float] = field(default_factory=dict)
    errands: dict[str, int] = field(default_factory=dict)
    done: frozenset[str] = frozenset()


class Planner(Protocol):
    """Decides where every vehicle goes next.

    The same situation, memory and generator state give the same answer. ``snapshot`` returns everything the planner
    remembers from step to step as bytes; ``restore`` on a new object of the same class continues as if nothing had
    happened.
    """

    def propose(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        """Return a configuration that obeys ``situation.constraints``."""
        ...

    def take_back(self, legs: Mapping[str, int]) -> bool:
        """Take back so many of the last legs of some vehicles: they are not flown, and will be decided anew.

        Returns False, and nothing is changed, where it does not know any more what it planned before them.
        """
        ...

    def snapshot(self) -> bytes:
        """Return the planner's memory."""
        ...

    def restore(self, memory: bytes) -> None:
        """Take up a memory made by ``snapshot``. Raises ValueError when it is not one."""
        ...
