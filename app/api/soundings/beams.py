"""Beams of swath sonars, and what operators say of them."""

import asyncio
from typing import Annotated, Any

import orjson
from fastapi import APIRouter, Path, Request, Response

from app.api.access.auth import Operator, Reader
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import body_problems, problems
from app.api.http.while_connected import while_connected
from app.api.mission import Mission
from app.api.schemas import API
from app.missions.live.mission import LiveMission
from app.missions.operations.corrections import beam_editing
from app.missions.views.measurements.beams import (
    BeamEditsView,
    BeamEditView,
    BeamPoints,
    BeamPointsRequest,
    BeamRulingRequest,
)
from app.missions.views.measurements.soundings import Ruling

router = APIRouter(
    route_class=JsonRoute,
    prefix=f"{API}/missions/{{mission_id}}/beams",
    tags=["maps"],
    responses=problems("unauthenticated", "forbidden", "mission-not-found", "invalid-request"),
)

_BEAMS = body_problems("conflict", "pings-unreadable")

EditId = Annotated[int, Path(ge=1, lt=2**62, description="The edit's number")]


@router.post(
    "/points",
    operation_id="selectBeams",
    summary="See beams as points",
    response_model=BeamPoints,
    responses=_BEAMS,
)
async def select_beams(reader: Reader, mission: Mission, request: Request, body: BeamPointsRequest) -> Any:
    """Return the beams of a selection column by column, whatever became of them: enough to draw them in space.

    Nothing stated: all. With more beams than `limit` those of every second ping come, or fourth, and so on.
    """
    return await while_connected(request, _points(mission, body))


async def _points(mission: LiveMission, body: BeamPointsRequest) -> Response:
    found = await beam_editing.beam_points(mission, body, body.limit)
    # A million numbers would hold everybody up while they are looked at one by one.
    content = await asyncio.to_thread(orjson.dumps, dict(found))
    return Response(content, media_type="application/json")


@router.post(
    "/reject", operation_id="rejectBeams", summary="Keep beams out", response_model=BeamEditView, responses=_BEAMS
)
async def reject_beams(operator: Operator, mission: Mission, request: Request, body: BeamRulingRequest) -> Any:
    """Take beams out of the map and of all that is made of it, by a selection or one by one.

    Their values stay. It goes by beam, not by place: however they are corrected later, these are out, and no others.
    Pings that come later are not concerned.
    """
    return await while_connected(request, beam_editing.rule_beams(mission, body, Ruling.REJECTED, operator.name))


@router.post(
    "/restore", operation_id="restoreBeams", summary="Let beams count", response_model=BeamEditView, responses=_BEAMS
)
async def restore_beams(operator: Operator, mission: Mission, request: Request, body: BeamRulingRequest) -> Any:
    """Take beams into the map whatever their neighbours are like: those left out as spikes, and rejected ones."""
    return await while_connected(request, beam_editing.rule_beams(mission, body, Ruling.RESTORED, operator.name))


@router.get("/edits", operation_id="listBeamEdits", summary="See what was said of beams")
async def list_beam_edits(reader: Reader, mission: Mission) -> BeamEditsView:
    """Return what operators said of beams, in the order in which they did: of each beam the last word counts."""
    return beam_editing.beam_edits(mission)


@router.delete(
    "/edits/{edit_id}",
    operation_id="withdrawBeamEdit",
    summary="Take back what was said of beams",
    responses=problems("beam-edit-not-found"),
)
async def withdraw_beam_edit(edit_id: EditId, operator: Operator, mission: Mission) -> BeamEditsView:
    """Take an edit back: what was said of its beams before it counts again."""
    return await beam_editing.withdraw_edit(mission, edit_id, operator.name)
