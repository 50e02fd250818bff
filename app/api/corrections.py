"""How soundings are corrected: tide and sound speed."""

from fastapi import APIRouter

from app.api.auth import Operator, Reader
from app.api.json_route import JsonRoute
from app.api.problems import problems
from app.api.schemas import API, MissionId
from app.api.state import Service
from app.missions.spec.mission import SoundSpeed
from app.missions.views.corrections import CorrectionsView, TideCorrection

router = APIRouter(
    route_class=JsonRoute,
    prefix=f"{API}/missions/{{mission_id}}",
    tags=["maps"],
    responses=problems("unauthenticated", "forbidden"),
)

_CHANGE = problems("malformed-body", "mission-not-found", "body-too-large", "unsupported-media-type", "invalid-request")


@router.get(
    "/corrections",
    operation_id="getCorrections",
    summary="See how soundings are corrected",
    responses=problems("mission-not-found", "invalid-request"),
)
async def get_corrections(mission_id: MissionId, service: Service, reader: Reader) -> CorrectionsView:
    """Return tide, sound speed and the datum that depths are counted from."""
    return await service.corrections(mission_id)


@router.put("/tide", operation_id="setTide", summary="Correct the tide", responses=_CHANGE)
async def set_tide(
    mission_id: MissionId, tide: TideCorrection, service: Service, operator: Operator
) -> CorrectionsView:
    """Set the water level or a tide table, at any time: every sounding is corrected anew from its raw depth."""
    return await service.set_tide(mission_id, tide, actor=operator.name)


@router.put("/sound-speed", operation_id="setSoundSpeed", summary="Correct the sound speed", responses=_CHANGE)
async def set_sound_speed(
    mission_id: MissionId, sound_speed: SoundSpeed, service: Service, operator: Operator
) -> CorrectionsView:
    """Set the measured sound speed, at any time: every sounding is corrected anew from its raw range."""
    return await service.set_sound_speed(mission_id, sound_speed, actor=operator.name)


@router.delete(
    "/sound-speed",
    operation_id="deleteSoundSpeed",
    summary="Take the sonars' own ranges",
    responses=problems("mission-not-found", "invalid-request"),
)
async def delete_sound_speed(mission_id: MissionId, service: Service, operator: Operator) -> CorrectionsView:
    """Correct no sound speed any more."""
    return await service.set_sound_speed(mission_id, None, actor=operator.name)
