"""How soundings are corrected: tide and sound speed."""

from fastapi import APIRouter

from app.api.auth import Operator, Reader
from app.api.json_route import JsonRoute
from app.api.mission import Mission
from app.api.problems import problems
from app.api.schemas import API
from app.missions.operations import recorrection
from app.missions.operations.recorrection import corrections_view
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
async def get_corrections(reader: Reader, mission: Mission) -> CorrectionsView:
    """Return tide, sound speed and the datum that depths are counted from."""
    return corrections_view(mission)


@router.put("/tide", operation_id="setTide", summary="Correct the tide", responses=_CHANGE)
async def set_tide(tide: TideCorrection, operator: Operator, mission: Mission) -> CorrectionsView:
    """Set the water level or a tide table, at any time: every sounding is corrected anew from its raw depth."""
    return await recorrection.set_tide(mission, tide, operator.name)


@router.put("/sound-speed", operation_id="setSoundSpeed", summary="Correct the sound speed", responses=_CHANGE)
async def set_sound_speed(sound_speed: SoundSpeed, operator: Operator, mission: Mission) -> CorrectionsView:
    """Set the measured sound speed, at any time: every sounding is corrected anew from its raw range."""
    return await recorrection.set_sound_speed(mission, sound_speed, operator.name)


@router.delete(
    "/sound-speed",
    operation_id="deleteSoundSpeed",
    summary="Take the sonars' own ranges",
    responses=problems("mission-not-found", "invalid-request"),
)
async def delete_sound_speed(operator: Operator, mission: Mission) -> CorrectionsView:
    """Correct no sound speed any more."""
    return await recorrection.set_sound_speed(mission, None, operator.name)
