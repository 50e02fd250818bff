"""The life of a mission and what an operator may ask for."""

import json
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from shapely.geometry import Polygon

from app.missions.maps.builder import make_grid
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED, MOVES, Action, MissionState, MoveRefusedError, allowed_actions, move
from app.missions.views.messages import StateMessage
from app.missions.views.mission import MissionSummary, Progress
from tests.support.missions.specs import LAT, LON, lon_lat, make_spec, rectangle, spec_json

S = MissionState
TABLE = {
    ("complete_draft", S.DRAFT): S.READY,
    ("reopen_draft", S.READY): S.DRAFT,
    ("start", S.READY): S.RUNNING,
    ("pause", S.RUNNING): S.PAUSED,
    ("resume", S.PAUSED): S.RUNNING,
    ("finish", S.RUNNING): S.FINISHED,
    ("finish", S.PAUSED): S.FINISHED,
    ("abort", S.DRAFT): S.ABORTED,
    ("abort", S.READY): S.ABORTED,
    ("abort", S.RUNNING): S.ABORTED,
    ("abort", S.PAUSED): S.ABORTED,
    ("fail", S.READY): S.FAILED,
    ("fail", S.RUNNING): S.FAILED,
    ("fail", S.PAUSED): S.FAILED,
}


@pytest.mark.parametrize("state", list(S))
@pytest.mark.parametrize("action", sorted(MOVES))
def test_every_action_moves_as_in_the_table_or_is_refused_with_reason_and_remedy(action: str, state: S) -> None:
    if (action, state) in TABLE:
        assert move(state, action) is TABLE[action, state]
        return
    with pytest.raises(MoveRefusedError) as caught:
        move(state, action)
    assert state in str(caught.value)
    assert all(allowed in str(caught.value) for known, allowed in TABLE if known == action)
    assert caught.value.remedy


@given(st.lists(st.sampled_from(sorted(MOVES)), max_size=30))
def test_whatever_is_asked_for_an_ended_mission_stays_ended(actions: list[str]) -> None:
    state = S.DRAFT
    for action in actions:
        before = state
        try:
            state = move(state, action)
        except MoveRefusedError:
            continue
        assert TABLE[action, before] is state
        assert before not in ENDED


@pytest.mark.parametrize("state", list(S))
def test_something_may_be_asked_of_a_mission_until_it_has_ended(state: S) -> None:
    assert allowed_actions(state) == [action for action in Action if (action, state) in TABLE]
    assert (not allowed_actions(state)) is (state in ENDED)


def test_one_entry_in_the_table_of_moves_allows_an_action_everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MOVES, "resume", MOVES["resume"] | {S.FAILED: S.RUNNING})
    at, length = datetime.now(UTC), {"steps": 1, "budget": {"steps": 1}}
    nothing = length | {"step": 0, "soundings": 0, "rejected": 0, "distance_m": 0}
    summary = MissionSummary(
        id="m", name="m", state=S.FAILED, created_at=at, updated_at=at, progress=Progress(**nothing, coverage_pct=0)
    )
    assert json.loads(StateMessage(mission=summary).model_dump_json())["mission"]["allowed_actions"] == ["resume"]
    assert move(S.FAILED, "resume") is S.RUNNING


def refusal(**changes: Any) -> str:
    with pytest.raises(ValidationError) as caught:
        MissionSpec.model_validate(spec_json(**changes))
    return "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in caught.value.errors())


def ring(*places: tuple[float, float]) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [[list(lon_lat(*place)) for place in places]]}


BOW_TIE = ring((0, 0), (30, 30), (30, 0), (0, 30), (0, 0))
OPEN = ring((0, 0), (30, 0), (30, 30), (0, 30))
LINE = ring((0, 0), (10, 0), (30, 0), (0, 0))


@pytest.mark.parametrize(
    ("changes", "field", "value", "remedy"),
    [
        ({"area": BOW_TIE}, "area.coordinates", "Self-intersection", "draw a simple polygon"),
        ({"area": OPEN}, "area.coordinates", "", "repeat the first position as the last"),
        ({"area": LINE}, "", "30.0 m x 0.0 m", "enlarge it"),
        ({"keep_out": [BOW_TIE]}, "keep_out.0.coordinates", "Self-intersection", "draw a simple polygon"),
        ({"area": {"type": "Polygon", "coordinates": [[[0, 91], [0, 0], [1, 1], [0, 91]]]}}, "area", "90", ""),
        ({"area": {"type": "Polygon", "coordinates": [[[0, "x"], [0, 0], [1, 1], [0, 0]]]}}, "area", "number", ""),
        ({"area": {"type": "Polygon", "coordinates": []}}, "area.coordinates", "at least 1", ""),
        (
            {"area": {"type": "Polygon", "coordinates": rectangle(0, 0, 30, 30)["coordinates"] * 2}},
            "area.coordinates",
            "at most 1",
            "",
        ),
        ({"area": rectangle(0, 0, 3, 30)}, "", "3.0 m x 30.0 m", "make cell_m at most 1.5"),
        ({"area": rectangle(0, 0, 9000, 9000)}, "", "cells", "make cell_m at least"),
        (
            {"area": {"type": "Polygon", "coordinates": [[[-80, 0], [80, 0], [80, 1], [-80, 0]]]}},
            "",
            "80.0",
            "within 200 km",
        ),
        ({"limits": {"min_depth_m": 5, "max_depth_m": 4}}, "limits", "max_depth_m is 4", "at least min_depth_m"),
        ({"limits": {"max_stp_m": 5}}, "limits.max_stp_m", "not permitted", ""),
        ({"limits": {"max_step_m": 0}}, "limits.max_step_m", "greater than 0", ""),
        ({"limits": {"max_step_m": float("nan")}}, "limits.max_step_m", "finite", ""),
        ({"vehicles": [{"name": "a"}, {"name": "a"}]}, "vehicles", "'a' is listed twice", "once"),
        ({"vehicles": [{"name": "../etc"}]}, "vehicles.0.name", "pattern", ""),
        ({"vehicles": [{"name": ""}]}, "vehicles.0.name", "at least 1", ""),
        ({"vehicles": [{"name": "a", "kind": "submarine"}]}, "vehicles.0.kind", "'rest'", ""),
        ({"vehicles": [{"name": "a", "depth_m": -1}]}, "vehicles.0.depth_m", "greater than or equal to 0", ""),
        ({"steps": 0}, "steps", "greater than or equal to 1", ""),
        ({"steps": 2.5}, "steps", "integer", ""),
        ({"name": ""}, "name", "at least 1", ""),
        ({"cell_m": float("inf")}, "cell_m", "finite", ""),
        ({"seed": -1}, "seed", "greater than or equal to 0", ""),
        ({"planner": {"name": "cao", "options": {"window": 1}}}, "planner.options.window", "greater than", ""),
    ],
)
def test_a_refused_mission_names_field_value_and_remedy(
    changes: dict[str, Any], field: str, value: str, remedy: str
) -> None:
    words = refusal(**changes)
    assert field in words
    assert value in words
    assert remedy in words


def test_an_area_too_narrow_for_a_cell_is_refused() -> None:
    sliver = ring((0, 0), (300, 299), (300, 300), (0, 0))
    assert "nowhere wide enough" in refusal(area=sliver)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0, 60), st.floats(0, 60)), min_size=3, max_size=3, unique=True),
    st.floats(0.5, 6.0),
)
def test_every_accepted_area_has_cells(corners: list[tuple[float, float]], cell_m: float) -> None:
    try:
        spec = make_spec(area=ring(*corners, corners[0]), cell_m=cell_m)
    except ValidationError:
        return
    _, mask = make_grid(spec.local_area(), cell_m)
    assert mask.any()


@pytest.mark.parametrize("clockwise", [False, True])
def test_the_local_area_is_in_metres_and_counter_clockwise(clockwise: bool) -> None:
    places = rectangle(0, 0, 40, 20)["coordinates"][0]
    spec = make_spec(area={"type": "Polygon", "coordinates": [places[::-1] if clockwise else places]})
    area = spec.local_area()
    assert Polygon(area).exterior.is_ccw
    np.testing.assert_allclose(
        sorted(map(tuple, area.round(3).tolist())), [(0, 0), (0, 20), (40, 0), (40, 20)], atol=0.02
    )
    frame = spec.frame()
    assert (frame.origin_lat_deg, frame.origin_lon_deg) == pytest.approx((LAT, LON), abs=1e-7)


def test_a_spec_survives_storage_as_json() -> None:
    spec = make_spec(keep_out=[rectangle(10, 10, 12, 12)], tide={"level_m": 1.2, "source": "gauge"})
    assert MissionSpec.model_validate(spec.model_dump(mode="json")) == spec
