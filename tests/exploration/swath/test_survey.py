"""A team's swath survey: everything is seen, nobody repeats, and a survey that is taken up goes on the same."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import BoolArray, FloatArray
from app.estimation.swath import SwathSonar
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints, inside_area
from app.exploration.core.coverage import Coverage, SwathTask
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner
from app.exploration.swath.raster import Flying, raster_of
from app.exploration.swath.survey import SwathSurvey
from app.exploration.swath.tries import MOST_TRIES, Tries

FLYING = Flying(SwathSonar(), 2.0, 1.0, 5.0, 0.06)


TURN_M = 4.0


class Sea:
    """A floor that is seen as vehicles fly straight legs over it, to both sides as far as the swath goes."""

    def __init__(self, depth_m: FloatArray) -> None:
        self.depth_m = depth_m
        self.seen = np.zeros(depth_m.shape, dtype=bool)
        rows, cols = np.indices(depth_m.shape)
        self._places = np.stack([cols + 0.5, rows + 0.5], axis=-1)

    def fly(self, start: FloatArray, end: FloatArray) -> None:
        leg = end - start
        length = float(np.hypot(*leg))
        if length < 1e-9:
            return
        along = (self._places - start) @ leg / length
        aside = np.abs((self._places - start) @ np.array([-leg[1], leg[0]]) / length)
        # Where legs meet at an angle a vehicle turns in an arc: no wedge is left out.
        self.seen |= (along >= -TURN_M) & (along <= length + TURN_M) & (aside <= FLYING.half_width_m(self.depth_m))

    def coverage(self) -> Coverage:
        wanted = np.ones(self.seen.shape, dtype=bool)
        return Coverage(0.0, 0.0, 1.0, wanted, self.seen.copy(), np.where(self.seen, self.depth_m, np.nan))


def sweep(
    sea: Sea, vehicles: int, *, interrupted: bool = False, crosslines: float = 0.0, refused: float = 0.0
) -> tuple[float, list[FloatArray]]:
    """Fly a survey to its end; the metres flown, and the legs' ends. ``refused``: share of legs that nobody flies."""
    rng = np.random.default_rng(0)
    survey = SwathSurvey(0.0, 1.0, 10.0, crosslines)
    poses = {f"v{k}": np.array([2.0 + 5.0 * k, 2.0, np.nan]) for k in range(vehicles)}
    flown, idle = 0.0, 0
    ends: list[FloatArray] = []
    for turn in range(2000):
        name = f"v{turn % vehicles}"
        if interrupted:
            kept = json.loads(json.dumps(survey.remember()))
            survey = SwathSurvey(1.0, 1.0, 10.0, crosslines)
            survey.recall(kept)
        end = survey.next_leg(name, poses[name], FLYING, sea.coverage(), dict(poses), 20.0)
        idle = idle + 1 if end is None else 0
        if idle > vehicles:
            return flown, ends
        if end is None or rng.random() < refused:
            continue
        leg = end - poses[name][:2]
        sea.fly(poses[name][:2], end)
        flown += float(np.hypot(*leg))
        poses[name] = np.array([*end, math.atan2(*leg)])
        ends.append(end)
    raise AssertionError("it does not end")


def test_a_site_of_one_swath_is_left_to_one_vehicle() -> None:
    alone, _ = sweep(Sea(np.full((40, 60), 30.0)), 1)
    team, _ = sweep(Sea(np.full((40, 60), 30.0)), 3)
    assert team < alone + 10.0


def test_memory_of_earlier_versions_is_read() -> None:
    sea = Sea(np.full((60, 80), 8.0))
    survey, pose = SwathSurvey(0.0, 1.0, 8.0), np.array([2.0, 2.0, np.nan])
    for _ in range(2):
        survey.next_leg("a", pose, FLYING, sea.coverage(), {"a": pose}, 20.0)
    kept = json.loads(json.dumps(survey.remember()))
    for sweep_of in kept["sweeps"].values():
        del sweep_of["ends"], sweep_of["counted"]
    again = SwathSurvey(0.0, 1.0, 8.0)
    again.recall(kept)
    assert again.next_leg("a", pose, FLYING, sea.coverage(), {"a": pose}, 20.0) is not None


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(st.integers(60, 110), st.integers(60, 110), st.integers(1, 4), st.floats(6.0, 30.0), st.floats(-0.1, 0.1))
def test_everything_is_seen(rows: int, cols: int, vehicles: int, depth_m: float, rise: float) -> None:
    sea = Sea(np.maximum(depth_m + rise * np.tile(np.arange(cols), (rows, 1)), 4.0))
    _, ends = sweep(sea, vehicles)
    assert sea.seen.mean() > 0.99
    assert (np.array(ends) > -2.0).all(), "hardly a cell beyond the area"
    assert (np.array(ends) < [cols + 2.0, rows + 2.0]).all()


@pytest.mark.slow
def test_one_vehicle_flies_hardly_more_than_the_lines() -> None:
    sea = Sea(np.full((180, 300), 20.0))
    flown, _ = sweep(sea, 1)
    assert flown < 1.3 * (3 * 300 + 2 * 60 + 30)


@pytest.mark.slow
def test_a_survey_that_is_taken_up_goes_on_the_same() -> None:
    depth = np.maximum(9.0 + 4.0 * np.sin(np.arange(150) / 20.0)[None] + np.zeros((100, 1)), 4.0)
    whole, parts = sweep(Sea(depth), 2), sweep(Sea(depth), 2, interrupted=True)
    assert np.allclose(whole[1], parts[1])


@pytest.mark.slow
@pytest.mark.parametrize("refused", [0.1, 0.5])
def test_what_was_refused_is_flown_later(refused: float) -> None:
    depth = np.maximum(12.0 - 0.05 * np.arange(120)[None] + np.zeros((100, 1)), 4.0)
    sea, calm = Sea(depth), Sea(depth)
    flown, _ = sweep(sea, 2, refused=refused)
    alone, _ = sweep(calm, 2)
    assert sea.seen.mean() > 0.99
    assert flown < 1.6 * alone, "without flying everything again"


def test_what_was_not_seen_under_way_is_left_when_all_was_flown() -> None:
    square = Constraints(np.array([[0.0, 0.0], [80.0, 0.0], [80.0, 60.0], [0.0, 60.0]]), max_step_m=25.0)
    sea, here, blind, rested = Sea(np.full((60, 80), 12.0)), np.array([[2.0, 2.0]]), 0, False
    planner = create_planner("swath", PlannerOptions(turn_radius_m=5.0))
    for _ in range(200):
        asked = replace(situation(sea.coverage(), square, here), at_rest=frozenset({"v0"} if rested else ()))
        proposal = planner.propose(asked, np.random.default_rng(0))
        if proposal.done:
            if rested:
                break
            rested = True  # What it measured is known by now.
            continue
        rested, end = False, proposal.positions[:, :2].copy()
        if sea.seen.mean() < 0.5 or blind == 3:
            sea.fly(here[0], end[0])
        else:
            blind += 1
        here = end
    else:
        raise AssertionError("it does not end")
    assert blind == 3, "its sonar saw nothing on three legs"
    assert sea.seen.mean() > 0.99


@pytest.mark.parametrize("interrupted", [False, True])
def test_who_is_refused_the_way_to_its_line_is_sent_to_its_beginning_again(interrupted: bool) -> None:
    sea = Sea(np.full((60, 80), 8.0))
    survey, pose = SwathSurvey(0.0, 1.0, 8.0), np.array([40.0, 2.0, np.nan])
    first = survey.next_leg("a", pose, FLYING, sea.coverage(), {"a": pose}, 20.0)
    if interrupted:
        kept = json.loads(json.dumps(survey.remember()))
        survey = SwathSurvey(0.0, 1.0, 8.0)
        survey.recall(kept)
    again = survey.next_leg("a", pose, FLYING, sea.coverage(), {"a": pose}, 20.0)
    assert first is not None
    assert again is not None
    assert np.allclose(first, again)


def test_a_line_whose_legs_are_never_flown_is_given_up() -> None:
    sea = Sea(np.full((60, 80), 10.0))
    sweep(sea, 1, refused=1.0)
    assert not sea.seen.any()


def test_who_is_past_the_end_of_its_line_takes_another_one() -> None:
    sea = Sea(np.full((120, 200), 8.0))
    survey = SwathSurvey(0.0, 1.0, 8.0)
    pose = np.array([2.0, 2.0, np.nan])
    for _ in range(3):
        end = survey.next_leg("a", pose, FLYING, sea.coverage(), {"a": pose}, 20.0)
        assert end is not None
        sea.fly(pose[:2], end)
        pose = np.array([*end, np.pi / 2])
    swept_away = np.array([199.5, pose[1], np.pi / 2])
    end = survey.next_leg("a", swept_away, FLYING, sea.coverage(), {"a": swept_away}, 20.0)
    assert end is not None
    assert np.isfinite(end).all()


def test_ground_that_lines_beside_it_saw_in_vain_is_not_given_up_before_a_line_leads_over_it() -> None:
    sea = Sea(np.full((60, 90), 20.0))
    hidden = np.zeros(sea.seen.shape, dtype=bool)
    hidden[20:23, 40:44] = True
    tries = Tries()
    tries.left(sea.coverage())
    over = raster_of(sea.coverage(), 0.0, 1.0, 20.0)
    only = replace(sea.coverage(), wanted=hidden)
    for _ in range(MOST_TRIES - 1):
        tries.count(np.array([[38.0, 21.5], [46.0, 21.5]]), FLYING, only, over)
    survey, pose = SwathSurvey(0.0, 1.0, 20.0), np.array([0.0, 10.0, 0.0])
    survey.recall(survey.remember() | {"tried": tries.remember()})
    while survey.piece_m("v0").size == 0:
        pose[:2] = survey.next_leg("v0", pose, FLYING, sea.coverage(), {"v0": pose}, 20.0)
    tries.recall(survey.remember()["tried"])
    assert tries.left(sea.coverage()).left[hidden].all()


def test_ground_is_not_given_up_while_its_last_line_is_under_way() -> None:
    sea = Sea(np.full((60, 300), 4.0))
    sea.seen[:] = True
    sea.seen[20:23, 200:260] = False
    survey = tried(SwathSurvey(0.0, 1.0, 4.0), sea, MOST_TRIES - 1)
    fly(survey, sea, {"a": np.array([5.0, 50.0, np.nan])})
    assert sea.seen.all()


@pytest.mark.slow
@pytest.mark.parametrize("vehicles", [1, 2])
def test_ground_that_cannot_be_seen_is_given_up(vehicles: int) -> None:
    sea = Sea(np.full((80, 160), 9.0))
    blind = np.zeros(sea.seen.shape, dtype=bool)
    blind[30:34, 60:66] = True
    blind[60:, 100:150] = True
    poses = {f"v{k}": np.array([2.0 + 5.0 * k, 2.0, np.nan]) for k in range(vehicles)}
    flown = fly(SwathSurvey(0.0, 1.0, 9.0), sea, poses, blind)
    alone = fly(SwathSurvey(0.0, 1.0, 9.0), Sea(sea.depth_m), poses)
    assert sea.seen[~blind].mean() > 0.99
    assert flown < alone + 2 * MOST_TRIES * 160.0


def test_missed_ground_is_passed_wherever_its_vehicle_sweeps() -> None:
    sea = Sea(np.full((200, 300), 4.0))
    sea.seen[:60] = True
    sea.seen[40:43, 230:290] = False
    survey, team = SwathSurvey(0.0, 1.0, 4.0), {"a": np.array([225.0, 35.0, 0.0]), "b": np.array([2.0, 198.0, 0.0])}
    for _ in range(6):
        end = survey.next_leg("a", team["a"], FLYING, sea.coverage(), dict(team), 20.0)
        assert end is not None
        sea.fly(team["a"][:2], end)
        team["a"] = np.array([*end, math.atan2(*(end - team["a"][:2]))])
        kept = survey.remember()
        kept["sweeps"]["a"]["share"] = {"low_m": 80.0, "high_m": 120.0, "sign": 1}
        survey.recall(kept)
    assert sea.seen[:60].all()


def tried(survey: SwathSurvey, sea: Sea, times: int) -> SwathSurvey:
    """Return the survey as if what is left had been looked at in vain so many times."""
    tries, coverage = Tries(), sea.coverage()
    tries.left(coverage)
    over = raster_of(coverage, 0.0, 1.0, 20.0)
    rows, cols = np.nonzero(coverage.left)
    for _ in range(times):
        over_it = np.array([[cols.min(), rows.mean()], [cols.max() + 1.0, rows.mean()]])
        tries.count(over_it, FLYING, coverage, over)
    survey.recall(survey.remember() | {"tried": tries.remember()})
    return survey


def fly(survey: SwathSurvey, sea: Sea, poses: dict[str, FloatArray], blind: BoolArray | None = None) -> float:
    """Fly a survey to its end from its vehicles' poses and return the metres; ``blind`` cells are never seen."""
    poses, flown, idle = dict(poses), 0.0, 0
    for turn in range(2000):
        name = list(poses)[turn % len(poses)]
        end = survey.next_leg(name, poses[name], FLYING, sea.coverage(), dict(poses), 20.0)
        if end is None:
            survey.expect_nothing(name)
        idle = idle + 1 if end is None else 0
        if idle > 2 * len(poses):
            return flown
        if end is None:
            continue
        leg = end - poses[name][:2]
        sea.fly(poses[name][:2], end)
        if blind is not None:
            sea.seen[blind] = False
        flown += float(np.hypot(*leg))
        poses[name] = np.array([*end, math.atan2(*leg)])
    raise AssertionError("it does not end")


def test_a_hole_is_left_to_who_waits_nearest() -> None:
    sea = Sea(np.full((100, 300), 8.0))
    sea.seen[:] = True
    sea.seen[40:48, 280:290] = False
    survey = SwathSurvey(0.0, 1.0, 8.0)
    far, near = np.array([5.0, 50.0, np.nan]), np.array([260.0, 50.0, np.nan])
    team = {"far": far, "near": near}
    assert survey.next_leg("far", far, FLYING, sea.coverage(), team, 20.0) is None
    assert survey.next_leg("near", near, FLYING, sea.coverage(), team, 20.0) is not None


def test_lines_are_left_to_who_flies_beside_them_however_often_another_asks() -> None:
    sea = Sea(np.full((400, 100), 8.0))
    sea.seen[60:] = True
    survey = SwathSurvey(0.0, 1.0, 8.0)
    near, far = np.array([2.0, 8.0, np.pi / 2]), np.array([50.0, 390.0, np.nan])
    team = {"near": near, "far": far}
    assert survey.next_leg("near", near, FLYING, sea.coverage(), team, 20.0) is not None
    kept = survey.remember()
    kept["sweeps"]["far"]["share"] = {"low_m": 60.0, "high_m": 1000.0, "sign": -1}
    kept["sweeps"]["near"]["share"] = {"low_m": -1000.0, "high_m": 60.0, "sign": 1}
    survey.recall(kept)
    shares = survey.remember()["sweeps"]["near"]["share"]
    for _ in range(3):
        assert survey.next_leg("far", far, FLYING, sea.coverage(), team, 20.0) is None
    assert survey.remember()["sweeps"]["near"]["share"] == shares


def test_a_hole_is_left_to_nobody_who_was_told_that_there_is_nothing() -> None:
    sea = Sea(np.full((100, 300), 8.0))
    sea.seen[:] = True
    survey = SwathSurvey(0.0, 1.0, 8.0)
    far, near = np.array([5.0, 50.0, np.nan]), np.array([260.0, 50.0, np.nan])
    team = {"far": far, "near": near}
    assert survey.next_leg("near", near, FLYING, sea.coverage(), team, 20.0) is None
    sea.seen[40:48, 280:290] = False
    assert survey.next_leg("far", far, FLYING, sea.coverage(), team, 20.0) is not None


def test_lines_are_left_to_nobody_when_all_were_told_that_there_is_nothing() -> None:
    sea = Sea(np.full((100, 300), 8.0))
    sea.seen[:] = True
    survey = SwathSurvey(0.0, 1.0, 8.0)
    far, near = np.array([5.0, 90.0, np.nan]), np.array([295.0, 30.0, np.nan])
    team = {"far": far, "near": near}
    for name, pose in team.items():
        assert survey.next_leg(name, pose, FLYING, sea.coverage(), team, 20.0) is None
    sea.seen[:60, 200:] = False
    assert survey.next_leg("far", far, FLYING, sea.coverage(), team, 20.0) is not None


def test_a_bent_strip_is_left_to_nobody_when_all_were_told_that_there_is_nothing() -> None:
    # One whose sonar sees less would sweep it, and others leave it to that one.
    sea = Sea(np.full((100, 300), 8.0))
    sea.seen[:] = True
    survey = SwathSurvey(0.0, 1.0, 8.0)
    far, near = np.array([5.0, 50.0, np.nan]), np.array([260.0, 50.0, np.nan])
    team = {"far": far, "near": near}
    for name, pose in team.items():
        assert survey.next_leg(name, pose, FLYING, sea.coverage(), team, 20.0) is None
    for k in range(40):
        sea.seen[20 + k, 230 + k : 233 + k] = False
        sea.seen[20 + k, 297 - k : 300 - k] = False
    assert survey.next_leg("far", far, FLYING, sea.coverage(), team, 20.0) is not None


def test_a_hole_beside_the_way_to_the_next_line_is_passed_at_once() -> None:
    sea = Sea(np.full((200, 300), 8.0))
    sea.seen[:60] = True
    sea.seen[40:44, 290:294] = False
    survey = SwathSurvey(0.0, 1.0, 8.0)
    pose = np.array([270.0, 30.0, np.pi / 2])
    for _ in range(6):
        end = survey.next_leg("a", pose, FLYING, sea.coverage(), {"a": pose}, 20.0)
        assert end is not None
        sea.fly(pose[:2], end)
        pose = np.array([*end, math.atan2(*(end - pose[:2]))])
    assert sea.seen[:60].all(), "before the lines over the rest"
    assert not sea.seen.all()


def test_what_another_line_may_still_see_is_not_filled() -> None:
    sea = Sea(np.full((60, 300), 8.0))
    sea.seen[:22] = True
    sea.seen[38:] = True
    sea.seen[38:46, 200:206] = False
    survey = SwathSurvey(0.0, 1.0, 8.0)
    first, other = np.array([2.0, 30.0, np.pi / 2]), np.array([290.0, 50.0, np.pi / 2])
    team = {"a": first, "b": other}
    end = survey.next_leg("a", first, FLYING, sea.coverage(), team, 20.0)
    assert end is not None
    assert survey.next_leg("b", other, FLYING, sea.coverage(), team, 20.0) is None


def test_nothing_is_left_to_a_vehicle_that_has_no_way_left() -> None:
    constraints = Constraints(np.array([[0.0, 0.0], [300.0, 0.0], [300.0, 100.0], [0.0, 100.0]]), (), max_step_m=25.0)
    sea = Sea(np.full((100, 300), 8.0))
    sea.seen[:] = True
    sea.seen[40:48, 280:290] = False
    both = situation(sea.coverage(), constraints, np.array([[5.0, 50.0], [260.0, 50.0]]))
    first = replace(both, moving=np.array([True, False]))
    for left_m, waits in ((500.0, True), (0.0, False)):
        planner = create_planner("swath", PlannerOptions(turn_radius_m=5.0))
        asked = replace(first, left_m=np.array([500.0, left_m]))
        assert ("v0" in planner.propose(asked, np.random.default_rng(0)).done) == waits


@pytest.mark.parametrize("interrupted", [False, True])
def test_crosslines_are_flown_last(interrupted: bool) -> None:
    depth = np.full((80, 140), 10.0)
    plain, _ = sweep(Sea(depth), 2)
    longer, ends = sweep(Sea(depth), 2, interrupted=interrupted, crosslines=0.3)
    assert longer > plain + 2 * 70.0
    last = np.array(ends[-12:])
    east, north = np.ptp(last, axis=0)
    assert north > 60.0, "across the area"
    assert east < 140.0


def situation(coverage: Coverage, constraints: Constraints, en_m: FloatArray) -> Situation:
    names = tuple(f"v{k}" for k in range(len(en_m)))
    nothing = Belief(
        np.array([[50.0, 50.0]]), np.full(1, np.nan), np.full(1, np.inf), np.zeros(1, bool), np.ones(1), 9.0
    )
    return Situation(
        1,
        100,
        names,
        np.column_stack([en_m, np.full(len(en_m), 2.0)]),
        np.full(len(en_m), np.nan),
        nothing,
        np.zeros((0, 2)),
        constraints,
        swath=SwathTask(coverage, dict.fromkeys(names, SwathSonar()), 0.06),
    )


AREA = np.array([[0.0, 0.0], [150.0, 0.0], [150.0, 120.0], [0.0, 120.0]])
ZONE = np.array([[60.0, 40.0], [90.0, 40.0], [90.0, 80.0], [60.0, 80.0]])


def fly_round_the_zone(here: FloatArray) -> float:
    """Fly a survey to its end from places (n, 2), and return which share was seen of all but the zone."""
    constraints = Constraints(AREA, (ZONE,), max_step_m=25.0, min_separation_m=0.0)
    sea = Sea(np.full((120, 150), 12.0))
    rows, cols = np.indices(sea.seen.shape)
    wanted = inside_area(constraints, np.column_stack([cols.ravel() + 0.5, rows.ravel() + 0.5])).reshape(rows.shape)
    planner = create_planner("swath", PlannerOptions(turn_radius_m=5.0))
    for _ in range(400):
        coverage = Coverage(0.0, 0.0, 1.0, wanted, sea.seen & wanted, np.where(sea.seen, sea.depth_m, np.nan))
        asked = situation(coverage, constraints, here)
        proposal = planner.propose(asked, np.random.default_rng(0))
        if proposal.done == set(asked.vehicles):
            return float(sea.seen[wanted].mean())
        assert (constraints.excess(asked.positions, proposal.positions[None], Bottom.unknown()) <= 1e-6).all()
        for k in range(len(here)):
            sea.fly(here[k], proposal.positions[k, :2])
        here = proposal.positions[:, :2].copy()
    raise AssertionError("it does not end")


def test_legs_obey_the_limits_and_see_all_but_the_zone() -> None:
    assert fly_round_the_zone(np.array([[3.0, 3.0], [10.0, 3.0]])) > 0.97


@pytest.mark.parametrize("inside_m", [0.001, 0.03])
def test_who_begins_a_little_too_near_to_a_zone_sees_all_the_same(inside_m: float) -> None:
    assert fly_round_the_zone(np.array([[75.0, 40.0 + inside_m]])) > 0.97


def test_who_waits_a_little_too_near_to_a_zone_keeps_nobody_from_going_on() -> None:
    constraints = Constraints(AREA, (ZONE,), max_step_m=25.0, min_separation_m=0.0)
    sea = Sea(np.full((120, 150), 10.0))
    sea.seen[:] = True
    sea.seen[20:30, 20:60] = False
    waits, flies = (88.4, 79.98), (97.0, 33.0)
    planner = create_planner("swath", PlannerOptions(turn_radius_m=4.0))
    asked = situation(sea.coverage(), constraints, np.array([waits, flies]))
    proposal = planner.propose(asked, np.random.default_rng(0))
    assert proposal.done == {"v0"}
    assert np.allclose(proposal.positions[0, :2], waits)
    assert np.hypot(*(proposal.positions[1, :2] - flies)) == pytest.approx(25.0, abs=0.1)


@pytest.mark.parametrize(
    ("depth_m", "radius_m", "hole", "at"),
    [
        (11.9, 2.26, np.s_[:22, 38:40], (38.148, 0.0)),
        (12.63, 4.91, np.s_[:24, 36:38], (37.81, 0.0)),
        (9.35, 3.16, np.s_[5:7, :7], (0.0, 4.765)),
    ],
)
def test_who_is_at_the_border_passes_over_a_hole_there(
    depth_m: float, radius_m: float, hole: tuple[slice, slice], at: tuple[float, float]
) -> None:
    # The nearest place to where the pass begins, outside, is where the vehicle is.
    square = Constraints(np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 50.0], [0.0, 50.0]]), max_step_m=25.0)
    sea, here = Sea(np.full((50, 50), depth_m)), np.array([at])
    sea.seen[:] = True
    sea.seen[hole] = False
    planner = create_planner("swath", PlannerOptions(turn_radius_m=radius_m))
    for _ in range(60):
        proposal = planner.propose(situation(sea.coverage(), square, here), np.random.default_rng(0))
        if proposal.done:
            break
        sea.fly(here[0], proposal.positions[0, :2])
        here = proposal.positions[:, :2]
    assert sea.seen.all()


def test_without_anything_to_ensonify_all_are_done() -> None:
    coverage = Coverage(0.0, 0.0, 1.0, np.ones((20, 20), bool), np.ones((20, 20), bool), np.full((20, 20), 8.0))
    square = Constraints(np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]]))
    planner = create_planner("swath", PlannerOptions())
    asked = situation(coverage, square, np.array([[5.0, 5.0]]))
    proposal = planner.propose(asked, np.random.default_rng(0))
    assert proposal.done == {"v0"}
    assert np.array_equal(proposal.positions, asked.positions)


def test_a_damaged_memory_is_refused() -> None:
    planner = create_planner("swath", PlannerOptions())
    with pytest.raises(ValueError, match="memory"):
        planner.restore(b"nonsense")


@pytest.mark.slow
@pytest.mark.parametrize("skips", [True, False])
def test_what_is_left_out_of_a_line_is_not_seen_and_all_else_is(skips: bool) -> None:
    sea = Sea(np.full((120, 200), 8.0))
    survey = SwathSurvey(0.0, 1.0, 8.0)
    pose = np.array([2.0, 2.0, np.nan])
    for turn in range(400):
        if skips and turn == 5:
            survey.put_back("a", pose[None, :2], keeps_line=True)
            assert survey.skip_line("a", pose[:2])
            kept = json.loads(json.dumps(survey.remember()))
            survey = SwathSurvey(1.0, 1.0, 8.0)
            survey.recall(kept)
        end = survey.next_leg("a", pose, FLYING, sea.coverage(), {"a": pose}, 20.0)
        if end is None:
            break
        sea.fly(pose[:2], end)
        pose = np.array([*end, math.atan2(*(end - pose[:2]))])
    else:
        raise AssertionError("it does not end")
    missing = int((~sea.seen).sum())
    # Neighbours see a part of it: lines bend to where the last one ended.
    assert (missing > 200) is skips
    assert missing < 0.1 * sea.seen.size
    assert not survey.skip_line("a", pose[:2]), "it is on no line any more"


def test_a_crossline_of_who_leaves_is_flown_by_another() -> None:
    sea = Sea(np.full((120, 200), 8.0))
    sea.seen[:] = True
    corner = np.array([2.0, 2.0, np.nan])

    def flown_m(leaves_after: int) -> float:
        """How far a second vehicle flies once a first one has got so many legs, and flew none of them."""
        survey = SwathSurvey(0.0, 1.0, 8.0, 0.3)
        for _ in range(leaves_after):
            assert survey.next_leg("a", corner, FLYING, sea.coverage(), {"a": corner}, 20.0) is not None
            survey.put_back("a", corner[None, :2], keeps_line=True)
        pose, length_m = corner, 0.0
        while (end := survey.next_leg("b", pose, FLYING, sea.coverage(), {"b": pose}, 20.0)) is not None:
            length_m += float(np.hypot(*(end - pose[:2])))
            pose = np.array([*end, math.atan2(*(end - pose[:2]))])
        return length_m

    assert flown_m(0) > 100.0
    assert flown_m(1) >= 0.95 * flown_m(0)
