"""Legs that are not flown yet are decided anew: the planner then plans as if it had never given them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from app.estimation import SingleBeam
from app.exploration.core.problem import Situation
from app.exploration.planner.base import PlannerBase
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner
from tests.support.exploration.situations import make_situation

LEFT_M = 700.0


def surveyor() -> PlannerBase:
    return create_planner("cao", PlannerOptions(search=200), SingleBeam(0.01))


def flown(planner: PlannerBase, situation: Situation, legs: int, seed: int = 0) -> list[NDArray[np.float64]]:
    """Let a planner decide so many legs for everybody, each from the end of the one before; return where they end."""
    rng, ends = np.random.default_rng(seed), [situation.positions]
    left = np.full(len(situation.vehicles), LEFT_M)
    for _ in range(legs):
        now = replace(situation, positions=ends[-1], left_m=left, moving=np.ones(len(left), dtype=np.bool_))
        ends.append(planner.propose(now, rng).positions)
        left = left - np.linalg.norm(ends[-1] - ends[-2], axis=1)
    return ends[1:]


@pytest.mark.parametrize("before", [0, 3, 9])
def test_what_is_taken_back_is_decided_again_as_it_was(before: int) -> None:
    situation, planner = make_situation(), surveyor()
    first = flown(planner, situation, before + 4)
    assert planner.take_back(dict.fromkeys(situation.vehicles, 4))
    start = situation if not before else replace(situation, positions=first[before - 1])
    way = np.zeros(len(situation.vehicles))
    for a, b in zip([situation.positions, *first], first[:before], strict=False):
        way = way + np.linalg.norm(b - a, axis=1)
    left, rng, here = LEFT_M - way, np.random.default_rng(1), start.positions
    for end in first[before:]:
        now = replace(start, positions=here, left_m=left, moving=np.ones(len(left), dtype=np.bool_))
        again = planner.propose(now, rng).positions
        np.testing.assert_allclose(again, end, atol=1e-6)
        left, here = left - np.linalg.norm(again - here, axis=1), again


def test_legs_of_one_vehicle_are_taken_back_while_the_others_keep_theirs() -> None:
    situation, planner = make_situation(), surveyor()
    flown(planner, situation, 5)
    before = memory(planner)
    one, *others = situation.vehicles
    assert planner.take_back({one: 2})
    after = memory(planner)
    for name in others:
        assert after["plan"][name] == before["plan"][name]
        assert after["backbone"][name] == before["backbone"][name]
        assert len(after["given"][name]) == 5
    assert len(after["given"][one]) == 3
    assert after["flown_m"] < before["flown_m"]


def test_legs_of_who_left_before_go_the_way_of_its_rest() -> None:
    """A vehicle that was out of reach while its rest was handed on is taken out with legs that it did not fly."""
    planner, both = surveyor(), make_situation()
    ends_m = flown(planner, both, 3)[-1][1:, :2]
    alone = make_situation(vehicles=both.vehicles[:1])
    flown(planner, alone, 1)
    planner.put_back(both.vehicles[1], ends_m, None)
    for routes in (memory(planner)["plan"], memory(planner)["backbone"]):
        assert routes[both.vehicles[1]] == ends_m.tolist()
    flown(planner, alone, 1)
    assert memory(planner)["plan"].keys() == set(alone.vehicles)
    backbone_m = np.array(memory(planner)["backbone"][both.vehicles[0]])
    assert np.abs(backbone_m - ends_m).sum(axis=1).min() < 1e-6


def test_more_than_was_given_is_not_taken_back() -> None:
    situation, planner = make_situation(), surveyor()
    flown(planner, situation, 2)
    before = planner.snapshot()
    assert not planner.take_back(dict.fromkeys(situation.vehicles, 3))
    assert planner.snapshot() == before


def test_legs_are_taken_back_after_a_restart_too() -> None:
    situation, planner, other = make_situation(), surveyor(), surveyor()
    flown(planner, situation, 5)
    other.restore(planner.snapshot())
    for one in (planner, other):
        assert one.take_back(dict.fromkeys(situation.vehicles, 3))
    assert planner.snapshot() == other.snapshot()


def test_planners_that_keep_no_legs_take_none_back() -> None:
    situation, planner = make_situation(), create_planner("random", PlannerOptions(), SingleBeam(0.01))
    assert not planner.take_back(dict.fromkeys(situation.vehicles, 1))


def memory(planner: PlannerBase) -> dict[str, Any]:
    found: dict[str, Any] = planner._remember()["model"]
    return {
        key: {k: np.asarray(v).tolist() if key != "given" else v for k, v in value.items()}
        if isinstance(value, dict)
        else value
        for key, value in found.items()
    }
