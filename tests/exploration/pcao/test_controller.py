"""The PCAO controller: the paper's equations, its symmetries, its bounds, its model file."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from app.arrays import FloatArray
from app.estimation import RangeSensor, Sensor, SingleBeam
from app.exploration.core.constraints import Constraints
from app.exploration.pcao.controller import (
    BLOCKS,
    E1,
    E2,
    SIZE,
    L,
    blocks,
    control,
    entries,
    gains,
    mixing,
    random_parameters,
    within_bounds,
    within_step,
)
from app.exploration.pcao.model import PcaoModel, Training, default_model
from app.exploration.pcao.planner import linked
from app.exploration.pcao.state import N_FIGURES, N_VECTORS, reduced_state
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner
from tests.support.exploration.situations import SQUARE, make_belief, make_situation

UNIT = 0.1


def world(rng: np.random.Generator, vehicles: int = 3, landmarks: int = 80) -> Any:
    positions = np.column_stack([rng.uniform(-0.8, 0.8, (vehicles, 2)), rng.uniform(0.1, 0.4, vehicles)])
    angle = rng.uniform(0, 2 * np.pi, vehicles)
    moves = np.column_stack([np.sin(angle), np.cos(angle)])
    left = np.where(rng.random(landmarks) < 0.6, rng.uniform(0.25, 1.0, landmarks), 0.0)
    depth = np.where(rng.random(landmarks) < 0.5, np.nan, rng.uniform(0.3, 0.9, landmarks))
    return positions, moves, rng.uniform(0.05, 0.4, vehicles), rng.uniform(-1, 1, (landmarks, 2)), depth, left


def state(
    positions: FloatArray, moves: FloatArray, heights: FloatArray, xy: FloatArray, depth: FloatArray, left: FloatArray
) -> Any:
    return reduced_state(positions, moves, heights, np.ascontiguousarray(xy), depth, left, len(xy) / 4.0, UNIT)


def literal(vectors: FloatArray, figures: FloatArray, schedule: Any, parameters: Any) -> Any:
    """Return u of one vehicle by eq. (13) to (16) as they stand: z, its Jacobian M_z, block-diagonal P, B."""
    x = np.concatenate([vectors[:, 0], vectors[:, 1], figures])
    n = len(x)
    beta = mixing(*schedule)
    P = np.zeros((L * n, L * n))
    of = blocks(parameters)
    for m in range(L):
        flat, tall = of[2 * m], of[2 * m + 1]
        at = m * n
        P[at : at + N_VECTORS, at : at + N_VECTORS] = flat
        P[at + N_VECTORS : at + 2 * N_VECTORS, at + N_VECTORS : at + 2 * N_VECTORS] = flat
        P[at + 2 * N_VECTORS : at + n, at + 2 * N_VECTORS : at + n] = tall
    z = np.concatenate([np.sqrt(b) * x for b in beta])
    # The mixing signals do not depend on what B leads into, so that the Jacobian's other part meets zeros of B.
    M = np.vstack([np.sqrt(b) * np.eye(n) for b in beta])
    B = np.zeros((n, 3))
    B[:N_VECTORS, 0] = 1.0
    B[N_VECTORS : 2 * N_VECTORS, 1] = 1.0
    B[2 * N_VECTORS, 2] = -1.0  # going deeper makes the height less
    return -B.T @ M.T @ P @ z


@pytest.mark.parametrize("seed", range(5))
def test_the_controller_is_the_papers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parameters = random_parameters(rng)[0]
    vectors, figures, schedule = state(*world(rng))
    u = control(vectors, figures, schedule, *gains(parameters))
    for v in range(len(u)):
        np.testing.assert_allclose(u[v], literal(vectors[v], figures[v], schedule[v], parameters), atol=1e-9)


@given(st.floats(0, 1), st.floats(0, 1))
def test_mixing_signals_share_the_whole(here: Any, left: Any) -> None:
    beta = np.array(mixing(here, left))
    assert (beta >= 0).all()
    assert beta.sum() == pytest.approx(1.0)


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.floats(0.1, 50))
def test_every_p_is_brought_within_its_bounds_and_stays_there(seed: int, size: Any) -> None:
    parameters = size * np.random.default_rng(seed).standard_normal(SIZE)
    bounded = within_bounds(parameters)
    for block in blocks(bounded):
        values = np.linalg.eigvalsh(block)
        assert values[0] >= E1 - 1e-9
        assert values[-1] <= E2 + 1e-9
    np.testing.assert_allclose(within_bounds(bounded), bounded, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_permuted_vehicles_have_permuted_states(seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions, moves, heights, xy, depth, left = world(rng, vehicles=5)
    order = rng.permutation(5)
    plain = state(positions, moves, heights, xy, depth, left)
    permuted = state(positions[order], moves[order], heights[order], xy, depth, left)
    for a, b in zip(plain, permuted, strict=True):
        np.testing.assert_allclose(a[order], b, atol=1e-12)


@pytest.mark.parametrize("turn", [np.array([[0.0, -1.0], [1.0, 0.0]]), np.array([[-1.0, 0.0], [0.0, 1.0]])])
def test_a_turned_or_mirrored_world_turns_or_mirrors_the_moves(turn: Any) -> None:
    rng = np.random.default_rng(1)
    positions, moves, heights, xy, depth, left = world(rng, landmarks=300)
    there = np.column_stack([positions[:, :2] @ turn.T, positions[:, 2]])
    vectors, figures, schedule = state(positions, moves, heights, xy, depth, left)
    turned = state(there, moves @ turn.T, heights, xy @ turn.T, depth, left)
    np.testing.assert_allclose(turned[0], vectors @ turn.T, atol=1e-9)
    np.testing.assert_allclose(turned[1], figures, atol=1e-12)
    np.testing.assert_allclose(turned[2], schedule, atol=1e-12)


def test_moves_keep_the_limit_of_each_direction_or_of_the_whole() -> None:
    u = np.random.default_rng(0).normal(0, 3, (50, 3))
    each = within_step(u, 0.05, True)
    whole = within_step(u, 0.05, False)
    assert np.abs(each).max() <= 0.05 + 1e-12
    assert np.linalg.norm(whole, axis=1).max() <= 0.05 + 1e-12
    np.testing.assert_allclose(np.arctan2(each[:, 0], each[:, 1]), np.arctan2(u[:, 0], u[:, 1]))


def test_a_model_comes_back_from_its_file_as_it_was() -> None:
    parameters = random_parameters(np.random.default_rng(3))[0]
    model = PcaoModel.of(parameters, Training(command="bathyfleet train", terrains=("a",), seeds=(0, 1)))
    again = PcaoModel.model_validate_json(model.model_dump_json())
    assert again == model
    np.testing.assert_array_equal(again.parameters, parameters)


def spoil(path: Any, value: Any) -> Any:
    document = json.loads(default_model().model_dump_json())
    part = document
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    return json.dumps(document)


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (("version",), 2, "Input should be 1"),
        (("P", 0, "horizontal", 0), [1.0], "must have 7 rows of 7 numbers"),
        (("P", 1, "vertical", 0, 1), 9.0, "not symmetric"),
        (("P", 2, "vertical", 0, 0), 99.0, "must lie between e1 = 0.01 and e2 = 10"),
        (("state", "vectors"), ["nearest"], "train it anew"),
    ],
)
def test_a_model_that_cannot_fly_is_refused_with_the_reason(path: Path, value: Any, says: Any) -> None:
    with pytest.raises(ValidationError, match=says):
        PcaoModel.model_validate_json(spoil(path, value))


def test_the_shipped_model_names_the_command_that_made_it() -> None:
    model = default_model()
    assert model.training.command.startswith("bathyfleet train --out FILE --terrains ")
    assert model.training.robots == 3
    assert [len(block) for block in blocks(model.parameters)] == list(BLOCKS)
    assert len(model.state.figures) == N_FIGURES


def test_a_mission_flies_with_the_model_that_it_names() -> None:
    other = PcaoModel.of(entries([np.eye(size) for size in BLOCKS]), Training())
    situation = make_situation(vehicles=("a", "b"), constraints=Constraints(SQUARE, max_step_m=5.0, max_depth_m=20.0))
    moves = [
        create_planner("pcao", PlannerOptions(model=model), RangeSensor(25.0))
        .propose(situation, np.random.default_rng(0))
        .positions
        for model in (None, other, None)
    ]
    np.testing.assert_array_equal(moves[0], moves[2])
    assert np.abs(moves[0] - moves[1]).max() > 0.1


@pytest.mark.parametrize("sensor", [SingleBeam(), RangeSensor(25.0)])
def test_a_zone_across_the_way_is_flown_round(sensor: Sensor) -> None:
    zone = np.array([[40.0, 0.0], [60.0, 0.0], [60.0, 70.0], [40.0, 70.0]])
    limits = Constraints(SQUARE, (zone,), max_step_m=8.0, max_depth_m=20.0, min_altitude_m=1.0)
    planner, belief = create_planner("pcao", sensor=sensor), make_belief()
    done = belief.xy_m[:, 0] < 60.0
    at = np.array([[20.0, 20.0, 4.0]])
    for step in range(1, 41):
        # Everything on this side is known: what is left lies behind the zone.
        known = belief.__class__(
            belief.xy_m, belief.depth_m, belief.sd_m, done, belief.weight, belief.correlation_length_m
        )
        situation = make_situation(step, vehicles=("a",), positions=at, constraints=limits, belief=known)
        to = planner.propose(situation, np.random.default_rng(step)).positions
        assert limits.feasible(at, to[None])[0]
        at = to
    assert at[0, 0] > 55.0


def test_linked_wishes_follow_the_leader_within_range() -> None:
    here = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.4, 0.0, 0.0]])
    wish = here + np.array([[-0.05, 0, 0], [0.05, 0, 0], [0.05, 0, 0]])
    out = linked(here, wish, 0.22, 0.05, leader=0)
    np.testing.assert_allclose(out[0], wish[0])
    apart = np.linalg.norm(out[:, None] - out[None], axis=2) + 9 * np.eye(3)
    assert apart.min(axis=1).max() <= 0.22
    assert np.linalg.norm(out - here, axis=1).max() <= 0.05 + 1e-9
