"""Soundings that are not in the map, and what operators say of them."""

from typing import Annotated

from fastapi import APIRouter, Path, Query
from pydantic import ConfigDict, Field

from app.api.access.auth import Operator, Reader
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import body_problems, problems
from app.api.mission import Mission
from app.api.schemas import API, ActionRequest
from app.missions.live.mission import LiveMission
from app.missions.operations.corrections.review import rule, rule_many, sounding_points, soundings_page
from app.missions.spec.base import Name
from app.missions.views.measurements.soundings import (
    Ruling,
    RulingsView,
    SoundingPage,
    SoundingPoints,
    SoundingState,
    SoundingView,
)

router = APIRouter(
    route_class=JsonRoute,
    prefix=f"{API}/missions/{{mission_id}}/soundings",
    tags=["maps"],
    responses=problems("unauthenticated", "forbidden", "mission-not-found", "invalid-request"),
)

TO_REVIEW = (SoundingState.REJECTED, SoundingState.DOUBTED, SoundingState.WITHDRAWN, SoundingState.RESTORED)

MOST_POINTS = 20_000
"""Points in an answer: parts of a second, and a megabyte."""

MOST_RULED = 20_000


class RulingRequest(ActionRequest):
    """Which soundings an operator decides about, and what is added to that."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"ids": [17, 18, 19], "note": "a school of fish"}]}
    )

    ids: list[Annotated[int, Field(ge=1, lt=2**62)]] = Field(
        min_length=1, max_length=MOST_RULED, description="Ids of soundings of this mission"
    )


SoundingId = Annotated[int, Path(ge=1, lt=2**62, description="The sounding's id")]


@router.get(
    "",
    operation_id="listSoundings",
    summary="See which soundings are not in the map, and why",
    responses=problems("vehicle-not-found"),
)
async def list_soundings(
    reader: Reader,
    mission: Mission,
    state: Annotated[
        list[SoundingState] | None,
        Query(
            max_length=len(SoundingState),
            description="Only soundings in these states; default: all that are not simply used",
        ),
    ] = None,
    vehicle: Annotated[Name | None, Query(description="Only this vehicle's")] = None,
    after: Annotated[int, Query(ge=0, lt=2**62, description="Only soundings with a larger id")] = 0,
    limit: Annotated[int, Query(ge=1, le=1000, description="Most soundings in the answer")] = 200,
) -> SoundingPage:
    """Return soundings with their raw values, whether they count and why not, in the order they came."""
    return await soundings_page(mission, state or TO_REVIEW, vehicle=vehicle, after=after, limit=limit)


@router.get("/points", operation_id="listSoundingPoints", summary="See all soundings as points")
async def list_sounding_points(
    reader: Reader,
    mission: Mission,
    after: Annotated[int, Query(ge=0, lt=2**62, description="Only soundings with a larger id")] = 0,
    limit: Annotated[int, Query(ge=1, le=MOST_POINTS, description="Most soundings in the answer")] = MOST_POINTS,
) -> SoundingPoints:
    """Return soundings column by column, whatever became of them: enough to draw them in space."""
    return await sounding_points(mission, after=after, limit=limit)


_RULING = body_problems("sounding-not-found", "conflict")


@router.post("/restore", operation_id="restoreSoundings", summary="Let many soundings count", responses=_RULING)
async def restore_soundings(operator: Operator, mission: Mission, body: RulingRequest) -> RulingsView:
    """Take soundings into the map whatever gate and neighbours say, all at once; the log keeps who did so."""
    return await rule_many(mission, body.ids, Ruling.RESTORED, note=body.note, actor=operator.name)


@router.post("/reject", operation_id="rejectSoundings", summary="Keep many soundings out", responses=_RULING)
async def reject_soundings(operator: Operator, mission: Mission, body: RulingRequest) -> RulingsView:
    """Take soundings out of the map, all at once; their values stay, the log keeps who did so."""
    return await rule_many(mission, body.ids, Ruling.REJECTED, note=body.note, actor=operator.name)


@router.post(
    "/{sounding_id}/restore", operation_id="restoreSounding", summary="Let a sounding count", responses=_RULING
)
async def restore_sounding(
    sounding_id: SoundingId,
    operator: Operator,
    mission: Mission,
    body: ActionRequest | None = None,
) -> SoundingView:
    """Take a sounding into the map whatever gate and neighbours say; the log keeps who did so."""
    return await _rule(mission, sounding_id, Ruling.RESTORED, operator.name, body)


@router.post("/{sounding_id}/reject", operation_id="rejectSounding", summary="Keep a sounding out", responses=_RULING)
async def reject_sounding(
    sounding_id: SoundingId,
    operator: Operator,
    mission: Mission,
    body: ActionRequest | None = None,
) -> SoundingView:
    """Take a sounding out of the map; its values stay, the log keeps who did so, and it can be restored."""
    return await _rule(mission, sounding_id, Ruling.REJECTED, operator.name, body)


async def _rule(
    mission: LiveMission, sounding_id: int, ruling: Ruling, actor: str, body: ActionRequest | None
) -> SoundingView:
    note = body.note if body is not None else ""
    return await rule(mission, sounding_id, ruling, note=note, actor=actor)
