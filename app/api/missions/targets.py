"""Moving targets: what is known of them, and the ranges that it is known from."""

from typing import Annotated

from fastapi import APIRouter, Query

from app.api.access.auth import Reader
from app.api.http.problems import problems
from app.api.mission import Mission
from app.api.schemas import API
from app.missions.operations.history import target_ranges_page
from app.missions.spec.base import Name
from app.missions.views.targets import TargetRangePage, TargetView

router = APIRouter(
    prefix=f"{API}/missions/{{mission_id}}/targets",
    tags=["targets"],
    responses=problems("unauthenticated", "forbidden", "mission-not-found", "invalid-request"),
)


@router.get("", operation_id="listTargets", summary="See what is known of a mission's moving targets")
async def list_targets(reader: Reader, mission: Mission) -> list[TargetView]:
    """Return every target of the mission, foretold from its last range until now."""
    return mission.target_views()


@router.get(
    "/ranges",
    operation_id="listTargetRanges",
    summary="See the ranges to targets, and which were used",
    responses=problems("mission-not-found", "target-not-found"),
)
async def list_target_ranges(
    reader: Reader,
    mission: Mission,
    target: Annotated[Name | None, Query(description="Only ranges to this target")] = None,
    after: Annotated[int, Query(ge=0, lt=2**62, description="Only ranges with a larger id")] = 0,
    limit: Annotated[int, Query(ge=1, le=1000, description="Most ranges in the answer")] = 200,
) -> TargetRangePage:
    """Return ranges as they were measured, with the verdict on each, in the order they were judged."""
    return await target_ranges_page(mission, target, after, limit)
