"""Line plans of missions: what is taken, what is refused and what is told of lines that are not flown as a whole."""

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from app.missions.errors import InvalidRequestError
from app.missions.operations.history import events_after
from app.missions.service import MissionService
from app.missions.spec.base import FieldError
from app.missions.spec.mission import MissionSpec
from app.missions.spec.survey_lines import MOST_LINES
from tests.support.missions.specs import lon_lat, rectangle, spec_json

Line = dict[str, Any]


def line(name: str, *corners_m: tuple[float, float], **more: Any) -> Line:
    return {"name": name, "coordinates": [list(lon_lat(*corner)) for corner in corners_m], **more}


LINES = [line(f"10{k}", (20.0 * k, 5.0), (20.0 * k, 95.0)) for k in range(1, 5)]


def described(lines: list[Line], **changes: Any) -> dict[str, Any]:
    shape: dict[str, Any] = {
        "vehicles": [{"name": "a", "kind": "sim"}, {"name": "b", "kind": "sim"}],
        "planner": {"name": "lawnmower"},
        "budget": {"minutes": 60},
        "survey_lines": lines,
    }
    return spec_json(100.0, **shape | changes)


def test_lines_of_a_plan_come_back_as_they_were_given() -> None:
    bent = line("bent", (5.0, 5.0), (50.0, 20.0), (95.0, 5.0), keep_direction=True)
    bent["coordinates"] = [[*place, -3.0] for place in bent["coordinates"]]
    spec = MissionSpec.model_validate(described([*LINES, bent]))
    again = MissionSpec.model_validate_json(spec.model_dump_json())
    assert [one.name for one in again.survey_lines] == ["101", "102", "103", "104", "bent"]
    assert again.survey_lines[4].keep_direction
    assert spec.local_line(again.survey_lines[4]) == pytest.approx(
        np.array([[5.0, 5.0], [50.0, 20.0], [95.0, 5.0]]), abs=0.01
    )
    assert again.lines_asked_for
    assert again.coverage.crosslines_pct == 0.0, "a plan has the crosslines that it is to have"


@pytest.mark.parametrize(
    ("lines", "field", "words"),
    [
        ([LINES[0], LINES[0]], "survey_lines.1.name", "is the name of survey_lines.0 already"),
        ([LINES[0] | {"name": " "}], "name", "pattern"),
        ([LINES[0] | {"name": "a\u0007b"}], "name", "cannot be shown"),
        ([LINES[0] | {"coordinates": LINES[0]["coordinates"][:1]}], "coordinates", "at least 2"),
        ([LINES[0] | {"coordinates": LINES[0]["coordinates"][:1] * 2}], "coordinates", "two that differ"),
        ([LINES[0] | {"coordinates": [[-8.7, float("nan")], [-8.7, 41.0]]}], "coordinates", "finite"),
        ([line("far", (5.0, 5.0), (900_000.0, 5.0))], "survey_lines.0", "nowhere near the area"),
        ([LINES[0] | {"coordinates": [[41.185, -8.705], [41.186, -8.705]]}], "survey_lines.0", "look exchanged"),
        ([LINES[0] | {"coordinates": [[-8.705, 41.185]] * 1001}], "coordinates", "at most 1000"),
        (
            [line(str(k), *[(float(j), float(j % 2)) for j in range(1000)]) for k in range(21)],
            "survey_lines",
            "21000 positions",
        ),
        ([LINES[0] | {"name": str(k)} for k in range(MOST_LINES + 1)], "survey_lines", "at most 2000"),
        ([line("long", *[(0.0, 0.0), (40_000.0, 0.0)] * 70)] * 1, "survey_lines", "at most 5000 km"),
    ],
)
def test_a_plan_that_cannot_be_is_refused_with_what_is_wrong(lines: list[Line], field: str, words: str) -> None:
    with pytest.raises(ValidationError) as caught:
        MissionSpec.model_validate(described(lines))
    [error] = caught.value.errors()
    own = error.get("ctx", {}).get("error")
    named = own.field if isinstance(own, FieldError) else ".".join(str(part) for part in error["loc"])
    assert field in named
    assert words in error["msg"]


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"planner": {"name": "cao"}}, "planner.name", "planner 'cao' flies where it finds best"),
        (
            {"planner": {"name": "lawnmower", "options": {"line_spacing_m": 10.0}}},
            "planner.options.line_spacing_m",
            "which say where lines lie",
        ),
        (
            {"planner": {"name": "lawnmower", "options": {"line_heading_deg": 10.0}}},
            "planner.options.line_heading_deg",
            "which say where lines lie",
        ),
        ({"coverage": {"crosslines_pct": 5.0}}, "coverage.crosslines_pct", "only lines of the plan are flown"),
        ({"keep_out": [rectangle(15.0, 1.0, 85.0, 98.0)]}, "survey_lines", "nothing of the lines lies inside the area"),
        ({"area": rectangle(0.0, 200.0, 100.0, 300.0)}, "survey_lines", "nothing of the lines lies inside the area"),
    ],
)
async def test_what_does_not_go_with_a_plan_is_refused(
    service: MissionService, changes: dict[str, Any], field: str, words: str
) -> None:
    spec = MissionSpec.model_validate(described(LINES, **changes))
    with pytest.raises(InvalidRequestError, match=words) as caught:
        await service.create(spec)
    assert caught.value.field == field
    with pytest.raises(InvalidRequestError, match=words):
        await service.previews.of(spec)
    assert await service.rows() == []


async def test_parts_that_are_not_flown_are_told_in_the_plan_and_in_the_log(service: MissionService) -> None:
    lines = [*LINES, line("outside", (-50.0, 150.0), (150.0, 150.0)), line("beyond", (90.0, 50.0), (150.0, 50.0))]
    spec = MissionSpec.model_validate(described(lines, keep_out=[rectangle(35.0, 40.0, 45.0, 60.0)]))
    view = await service.previews.of(spec)
    [told] = [words for words in view.assumptions if "not flown" in words]
    assert told.startswith("Parts of 3 lines lie outside the area or in keep-out zones and are not flown: 102 (")
    assert "outside (200 m), beyond (50 m)" in told
    live = await service.get((await service.create(spec)).id)
    assert told[1:-1] in " ".join(event.message for event in await events_after(live))


async def test_the_log_says_it_of_lines_that_are_described_anew(service: MissionService) -> None:
    live = await service.get((await service.create(MissionSpec.model_validate(described(LINES)))).id)
    lines = [*LINES, line("beyond", (90.0, 50.0), (150.0, 50.0))]
    await service.describe_anew(live, MissionSpec.model_validate(described(lines)))
    live = await service.get(live.id)
    told = [event.message for event in await events_after(live) if "not flown" in event.message]
    assert told == ["parts of 1 line lie outside the area or in keep-out zones and are not flown: beyond (50 m)"]


async def test_the_plan_is_drawn_over_the_lines_with_what_all_of_them_take(service: MissionService) -> None:
    view = await service.previews.of(MissionSpec.model_validate(described(LINES)))
    assert view.whole_survey is not None
    assert view.whole_survey.within_budget
    assert 4 * 90.0 < view.whole_survey.distance_m < 4 * 90.0 + 2 * 100.0 + 4 * 20.0
    assert not [words for words in view.assumptions if "not flown" in words or "left out" in words]
    places = {tuple(place) for vehicle in view.vehicles for place in vehicle.way}
    ends = [place for one in LINES for place in one["coordinates"]]
    assert all(any(abs(e - x) + abs(n - y) < 1e-6 for e, n in places) for x, y in ends), "each is flown to its ends"
    short = await service.previews.of(MissionSpec.model_validate(described(LINES, budget={"km_per_vehicle": 0.05})))
    assert short.whole_survey is not None
    assert not short.whole_survey.within_budget


async def test_lines_that_nobody_can_reach_are_named_in_the_plan(service: MissionService) -> None:
    across = [line(name, (5.0, north), (95.0, north)) for name, north in (("south", 10.0), ("north", 90.0))]
    bar = rectangle(-10.0, 45.0, 110.0, 55.0)
    spec = MissionSpec.model_validate(described(across, keep_out=[bar]))
    view = await service.previews.of(spec)
    [told] = [words for words in view.assumptions if "left out" in words]
    assert told.startswith("0.09 km of lines are left out (north (90 m)): keep-out zones cut the area")
    assert view.whole_survey is None
