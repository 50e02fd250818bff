"""Steps decided for a planner whose wishes are given."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from app.exploration.core.problem import Belief, Proposal, Situation
from app.missions.flight.decisions.decision import Decision, Knowledge, decide
from app.missions.flight.decisions.leg import Place
from app.missions.spec.mission import MissionSpec
from app.missions.task.constraints import make_constraints
from tests.support.missions.specs import make_spec


class Wishes:
    """A planner that proposes what it is told to."""

    def __init__(self, positions: list[list[float]]) -> None:
        self.positions = np.array(positions)
        self.asked: list[Situation] = []

    def propose(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        self.asked.append(situation)
        return Proposal(self.positions, 0.5, {"gain": 1.0})

    def take_back(self, legs: Mapping[str, int]) -> bool:
        return not any(legs.values())

    def snapshot(self) -> bytes:
        return b"memory"

    def restore(self, memory: bytes) -> None:
        raise NotImplementedError


def belief_of(depth_m: float = 9.0, sd_m: float = 0.5) -> Belief:
    east, north = np.meshgrid(np.arange(1.0, 60.0, 4.0), np.arange(1.0, 60.0, 4.0))
    n = east.size
    return Belief(
        np.column_stack([east.ravel(), north.ravel()]),
        np.full(n, depth_m),
        np.full(n, sd_m),
        np.zeros(n, dtype=bool),
        np.ones(n),
        8.0,
    )


def place(name: str, east_m: float, north_m: float, depth_m: float = 2.0) -> Place:
    return Place(name, np.array([east_m, north_m]), math.nan, depth_m)


def decide_for(
    places: list[Place],
    wishes: list[list[float]],
    belief: Belief | None = None,
    water_level_m: float = 0.0,
    **changes: Any,
) -> tuple[Decision, Wishes, MissionSpec]:
    spec = make_spec(60.0, **({"limits": {"max_step_m": 12.0, "max_depth_m": 20.0}} | changes))
    planner = Wishes(wishes)
    belief = belief or belief_of()
    known = Knowledge(belief, np.zeros((0, 2)), water_level_m)
    decision = decide(1, spec, make_constraints(spec), planner, places, known)
    return decision, planner, spec
