import itertools
import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.estimation import RangeSensor, Sensor, SingleBeam
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.base import PlannerBase
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import PLANNERS, create_planner
from app.exploration.survey.error import expected_roughness
from tests.support.exploration.situations import SQUARE, make_belief, make_situation

QUICK = {"search": 30, "candidates": 24, "rollouts": 20}
KINDS = [
    ("cao", "map"),
    ("cao", "polynomial"),
    ("lawnmower", "map"),
    ("random", "map"),
    ("spsa", "map"),
    ("fdsa", "map"),
    ("pcao", "map"),
    ("rollout", "map"),
]
SENSORS = [SingleBeam(), RangeSensor(visibility_m=25.0)]


BEAM = SingleBeam()


def make(name: str, regressors: str = "map", *, sensor: Sensor = BEAM) -> PlannerBase:
    return create_planner(name, PlannerOptions(regressors=regressors, **QUICK), sensor)


def fly(
    planner: PlannerBase,
    steps: int,
    *,
    total: int = 60,
    seed: int = 0,
    start: Any = None,
    names: tuple[Any, ...] = ("a", "b"),
    constraints: Any = None,
    belief: Any = None,
) -> Iterator[Any]:
    """Fly a planner in closed loop; yields the situation and what was proposed."""
    situation = make_situation(vehicles=names, positions=start, constraints=constraints, belief=belief, steps=total)
    positions, soundings = situation.positions, situation.soundings_en_m
    for step in range(1, steps + 1):
        situation = make_situation(
            step,
            steps=total,
            vehicles=names,
            positions=positions,
            soundings=soundings,
            constraints=constraints,
            belief=belief,
        )
        proposal = planner.propose(situation, np.random.default_rng([seed, step]))
        yield situation, proposal
        positions = proposal.positions
        soundings = np.vstack([soundings, positions[:, :2]])


limits = st.fixed_dictionaries(
    {
        "max_step_m": st.sampled_from([4.0, 10.0]),
        "com_range_m": st.sampled_from([np.inf, 40.0]),
        "min_separation_m": st.sampled_from([0.0, 3.0]),
        "min_altitude_m": st.sampled_from([0.5, 2.0]),
        "keep_out": st.sampled_from([(), (np.array([[30.0, 20.0], [60.0, 25.0], [50.0, 60.0], [35.0, 55.0]]),)]),
    }
)


@pytest.mark.parametrize("sensor", SENSORS, ids=["bathymeter", "landmarks"])
@pytest.mark.parametrize("kind", KINDS, ids="-".join)
@given(limits=limits, seed=st.integers(0, 100))
@settings(max_examples=5, deadline=None)
def test_no_proposal_breaks_a_constraint(kind: str, sensor: Sensor, limits: Any, seed: int) -> None:
    constraints = Constraints(SQUARE, max_depth_m=20.0, **limits)
    belief = make_belief(seed)
    bottom = Bottom.from_landmarks(belief.xy_m, belief.depth_m)
    planner = make(*kind, sensor=sensor)
    for situation, proposal in fly(planner, 6, seed=seed, constraints=constraints, belief=belief):
        names = situation.vehicles
        assert constraints.violations(names, situation.positions, proposal.positions, bottom) == ()


@pytest.mark.parametrize("sensor", SENSORS, ids=["bathymeter", "landmarks"])
@pytest.mark.parametrize("kind", KINDS, ids="-".join)
def test_same_seed_same_answers(kind: str, sensor: Sensor) -> None:
    first, second = ([p.positions for _, p in fly(make(*kind, sensor=sensor), 5)] for _ in range(2))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("sensor", SENSORS, ids=["bathymeter", "landmarks"])
@pytest.mark.parametrize("kind", KINDS, ids="-".join)
def test_permuting_vehicles_permutes_the_answer(kind: str, sensor: Sensor) -> None:
    names, start = ("a", "b", "c"), np.array([[3.0, 3, 2], [9.0, 3, 2], [15.0, 3, 2]])
    straight = [p.positions for _, p in fly(make(*kind, sensor=sensor), 4, names=names, start=start)]
    order = [2, 0, 1]
    turned = fly(make(*kind, sensor=sensor), 4, names=tuple(names[i] for i in order), start=start[order])
    for expected, (_, proposal) in zip(straight, turned, strict=True):
        np.testing.assert_array_equal(expected[order], proposal.positions)


@pytest.mark.parametrize("sensor", SENSORS, ids=["bathymeter", "landmarks"])
@pytest.mark.parametrize("kind", KINDS, ids="-".join)
def test_a_restored_planner_continues_as_if_nothing_had_happened(kind: str, sensor: Sensor) -> None:
    planner, memory = make(*kind, sensor=sensor), b""
    for situation, proposal in fly(planner, 8):
        if situation.step >= 4:
            restored = make(*kind, sensor=sensor)
            restored.restore(memory)
            again = restored.propose(situation, np.random.default_rng([0, situation.step]))
            np.testing.assert_array_equal(again.positions, proposal.positions)
            assert restored.snapshot() == planner.snapshot()
        memory = planner.snapshot()


@pytest.mark.parametrize("kind", KINDS, ids="-".join)
def test_a_memory_that_lacks_a_field_leaves_nothing_behind(kind: str) -> None:
    """As one that another version wrote: it is refused, and the planner can begin anew."""
    planner = make(*kind)
    for _ in fly(planner, 2):
        pass
    whole = json.loads(planner.snapshot())
    blank = make(*kind).snapshot()
    refused = 0
    for field in whole["memory"]:
        again = make(*kind)
        lacking = whole | {"memory": {name: value for name, value in whole["memory"].items() if name != field}}
        try:
            again.restore(json.dumps(lacking).encode())
        except ValueError:
            refused += 1
            again.restore(blank)
            assert again.snapshot() == blank
    assert refused


@pytest.mark.parametrize("memory", [b"", b"{}", b"[1]", b"\xff", b'{"kind":"cao","version":1,"memory":{}}'])
@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_a_foreign_memory_is_refused(name: str, memory: Any) -> None:
    with pytest.raises(ValueError, match="planner memory"):
        make(name).restore(memory)


def test_an_unknown_planner_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match="choose one of cao, fdsa, lawnmower, pcao, random, rollout, spsa"):
        create_planner("magic")


def test_a_yardstick_that_really_tries_its_moves_is_refused_with_the_reason() -> None:
    with pytest.raises(ValueError, match="osarses really tries its moves"):
        create_planner("osarses")


@pytest.mark.parametrize("kind", KINDS, ids="-".join)
def test_vehicles_may_leave_and_join_between_steps(kind: str) -> None:
    planner = make(*kind)
    teams = [("a", "b"), ("a", "b"), ("b",), ("b",), ("b", "c"), ("a", "b", "c"), ()]
    places = {"a": [3.0, 3.0, 2.0], "b": [9.0, 3.0, 2.0], "c": [50.0, 50.0, 2.0]}
    for step, names in enumerate(teams, 1):
        at = np.array([places[v] for v in names]).reshape(-1, 3)
        situation = make_situation(step, vehicles=names, positions=at)
        proposal = planner.propose(situation, np.random.default_rng(step))
        assert proposal.positions.shape == (len(names), 3)
        if names:
            assert situation.constraints.feasible(at, proposal.positions[None])[0]
        places.update(zip(names, proposal.positions.tolist(), strict=True))


def test_a_vehicle_outside_the_area_comes_back() -> None:
    planner = make("random")
    start = np.array([[-6.0, 50.0, 2.0]])
    last = list(fly(planner, 4, names=("a",), start=start))[-1][1]
    assert last.positions[0, 0] >= 0.0


def track(planner: PlannerBase, steps: int, **kwargs: Any) -> Any:
    flown = [p.positions for _, p in fly(planner, steps, total=steps, **kwargs)]
    start = make_situation(vehicles=kwargs.get("names", ("a", "b"))).positions
    return np.stack([start, *flown])


def distances_to_track(positions: FloatArray, spacing: float = 0.5) -> Any:
    points = [
        start + f * (end - start)
        for j in range(positions.shape[1])
        for start, end in itertools.pairwise(positions[:, j, :2])
        for f in np.arange(0.0, 1.0, spacing / 10.0)
    ]
    axis = np.arange(1.0, 100.0, 2.0)
    nodes = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return np.sqrt(((nodes[:, None, :] - np.array(points)[None]) ** 2).sum(axis=2).min(axis=1))


@pytest.mark.parametrize("name", ["lawnmower", "cao"])
def test_surveys_leave_no_large_gap_where_nothing_is_known(name: str) -> None:
    positions = track(make(name), 60, belief=make_belief(known=False))
    # 1200 m in 10 000 m2: lines 8.3 m apart at best.
    assert distances_to_track(positions).max() < 10.0


def test_the_lawnmower_spends_its_budget_on_even_lines() -> None:
    positions = track(make("lawnmower"), 60)
    for j in range(2):
        length = np.linalg.norm(np.diff(positions[:, j], axis=0), axis=1).sum()
        assert 400.0 < length <= 600.0 + 1e-6


@pytest.mark.slow
def test_cao_goes_where_the_bottom_is_rough() -> None:
    belief = make_belief(known=False, cell=2.5)
    rough = (belief.xy_m > 60.0).all(axis=1)
    weight = np.where(rough, 4.0, 0.3)
    sd = np.where(rough, 1.0, 0.3)
    patchy = Belief(belief.xy_m, np.full(len(weight), 9.0), sd, belief.accurate, weight, 20.0)
    positions = track(create_planner("cao"), 60, belief=patchy)
    axis = np.arange(1.0, 100.0, 2.0)
    nodes = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    distance = distances_to_track(positions)
    inside = (nodes > 60.0).all(axis=1)
    assert np.mean(distance[inside] ** 2) < 0.6 * np.mean(distance[~inside] ** 2)


def test_surveying_vehicles_keep_their_depths_and_the_clearance() -> None:
    depth = np.where(make_belief().xy_m[:, 0] > 50.0, 3.0, 9.0)
    belief = make_belief()
    shelf = Belief(belief.xy_m, depth, belief.sd_m, belief.accurate, belief.weight, 20.0)
    constraints = Constraints(SQUARE, max_step_m=10.0, max_depth_m=20.0, min_altitude_m=1.5)
    bottom = Bottom.from_landmarks(shelf.xy_m, shelf.depth_m)
    reached = []
    for _, proposal in fly(make("lawnmower"), 40, belief=shelf, constraints=constraints):
        floor = bottom.at(proposal.positions[:, :2])
        assert (floor - proposal.positions[:, 2] >= 1.5 - 1e-6).all()
        reached.extend(proposal.positions[:, 2])
    assert max(reached) == pytest.approx(2.0)
    # A leg that leads slantwise over the edge rises before it.
    assert 0.9 < min(reached) < 1.51


@pytest.mark.slow
def test_a_team_in_formation_keeps_in_touch() -> None:
    cube = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    axis = np.linspace(-0.95, 0.95, 20)
    east, north = np.meshgrid(axis, axis)
    xy = np.column_stack([east.ravel(), north.ravel()])
    n = len(xy)
    belief = Belief(xy, np.full(n, 0.6), np.full(n, 0.1), np.zeros(n, bool), np.ones(n), 0.2)
    constraints = Constraints(cube, (), 0.05, -1.0, 1.0, 0.05, 0.3)
    positions = np.array([[-0.8, -0.8, 0.4], [-0.75, -0.8, 0.4], [-0.7, -0.8, 0.4]])
    planner = create_planner("lawnmower", sensor=RangeSensor())
    seen = np.zeros(n, dtype=bool)
    for step in range(1, 301):
        situation = Situation(
            step, 300, ("a", "b", "c"), positions, np.full(3, np.nan), belief, np.zeros((0, 2)), constraints
        )
        after = planner.propose(situation, np.random.default_rng(step)).positions
        assert constraints.feasible(positions, after[None])[0]
        positions = after
        seen |= RangeSensor().visible(positions, np.column_stack([xy, belief.depth_m])).any(axis=0)
    assert seen.mean() > 0.99


def test_an_edge_between_two_lines_counts_although_no_sounding_shows_it() -> None:
    belief = make_belief(known=False)
    east = belief.xy_m[:, 0]
    step = Belief(
        belief.xy_m, 6.0 + np.clip((east - 50.0) / 10.0, 0.0, 1.0), np.full(len(east), 0.3), belief.accurate,
        np.ones(len(east)), 20.0,
    )  # fmt: skip
    distance = np.full(len(east), 5.0)
    roughness = expected_roughness(step, distance, 10.0)
    on_edge = (east > 50.0) & (east < 60.0)
    assert roughness[on_edge].min() > 1.5 * roughness[~on_edge & (np.abs(east - 55.0) > 20.0)].max()
    assert np.allclose(expected_roughness(belief, distance, 10.0), 1.0)


@pytest.mark.parametrize(("name", "regressors"), [("cao", "map"), ("lawnmower", "map"), ("random", "map")])
def test_who_gets_no_leg_stays_and_loses_nothing_of_its_plan(name: str, regressors: str) -> None:
    """A team whose vehicles are decided for one after the other flies as much of its plan as one that goes together."""
    planner = make(name, regressors)
    assert planner.decides_apart
    names = ("a", "b", "c")
    situation = make_situation(vehicles=names, steps=40)
    positions, soundings = situation.positions, [situation.positions[:, :2]]
    left_m = np.full(3, 250.0)
    flown = [[place[:2]] for place in positions]
    for step in range(1, 61):
        moving = np.arange(3) == (step - 1) % 3
        rest = planner.ways_ahead_m().get(names[(step - 1) % 3])
        situation = replace(
            make_situation(
                1 + step // 3, steps=40, vehicles=names, positions=positions, soundings=np.vstack(soundings)
            ),
            moving=moving,
            left_m=left_m,
        )
        proposed = planner.propose(situation, np.random.default_rng(step)).positions
        np.testing.assert_array_equal(proposed[~moving], positions[~moving])
        assert not situation.constraints.violations(names, positions, proposed)
        left_m = left_m - np.linalg.norm(proposed - positions, axis=1)
        soundings.append(proposed[moving, :2])
        if name != "lawnmower" or rest is None or len(rest):  # what it flies after its lines leads anywhere
            flown[(step - 1) % 3].append(proposed[moving][0, :2])
        positions = proposed
    if name == "lawnmower":
        # All its lines run one way: no leg of it goes diagonally, as one that left something out would.
        for track in flown:
            leg = np.abs(np.diff(np.array(track), axis=0))[1:]
            along = leg.min(axis=1) < 3.0
            assert along[int(np.argmax(along)) :].all(), "from where it begins its first line on"
            assert along.sum() > 10


def test_who_waits_where_it_may_not_be_keeps_nobody_from_going_on() -> None:
    zone = np.array([[40.0, 40.0], [60.0, 40.0], [60.0, 60.0], [40.0, 60.0]])
    limits = Constraints(SQUARE, (zone,), max_step_m=10.0, max_depth_m=20.0)
    both = make_situation(positions=np.array([[50.0, 40.02, 2.0], [20.0, 20.0, 2.0]]), constraints=limits)
    asked = replace(both, moving=np.array([False, True]))
    planner = create_planner("random", PlannerOptions(cruise_depth_m=2.0))
    positions = planner.propose(asked, np.random.default_rng(0)).positions
    assert np.array_equal(positions[0], asked.positions[0])
    assert np.hypot(*(positions[1] - asked.positions[1])[:2]) > 1.0


@pytest.mark.parametrize("name", ["cao", "rollout", "spsa", "fdsa"])
def test_an_area_that_its_zones_cover_is_refused_in_words(name: str) -> None:
    middle = SQUARE.mean(axis=0)
    covering = replace(make_situation().constraints, keep_out=(middle + 1.5 * (SQUARE - middle),))
    situation = replace(make_situation(), constraints=covering)
    with pytest.raises(ValueError, match="leave nothing of the area to map"):
        create_planner(name, PlannerOptions(search=8), SingleBeam()).propose(situation, np.random.default_rng(0))
