"""How soundings are corrected: tide, sound speed, systematic errors, and the drift of vehicles."""

from fastapi import APIRouter

from app.api.access.auth import Operator, Reader
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import body_problems, problems
from app.api.mission import Mission
from app.api.schemas import API
from app.api.state import Service
from app.missions.operations.corrections import adjustment, recorrection
from app.missions.operations.corrections.recorrection import corrections_view
from app.missions.operations.corrections.systematic_errors import systematic_errors
from app.missions.operations.maps.mission_maps import newest_map
from app.missions.spec.systematic_errors import SystematicErrors
from app.missions.spec.water import SoundSpeed
from app.missions.views.measurements.adjustment import AdjustmentRequest, AdjustmentView
from app.missions.views.measurements.corrections import CorrectionsView, TideCorrection
from app.missions.views.measurements.systematic_errors import SystematicErrorsView

router = APIRouter(
    route_class=JsonRoute,
    prefix=f"{API}/missions/{{mission_id}}",
    tags=["maps"],
    responses=problems("unauthenticated", "forbidden"),
)

_CHANGE = body_problems("mission-not-found")


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


@router.get(
    "/systematic-errors",
    operation_id="getSystematicErrors",
    summary="See what is always wrong",
    responses=problems("mission-not-found", "invalid-request", "map-not-ready", "pings-unreadable"),
)
async def get_systematic_errors(service: Service, reader: Reader, mission: Mission) -> SystematicErrorsView:
    """Return what lines that cross and swaths that overlap show of depth offsets, water level, roll and sound speed.

    Each with how sure it is; `proposal` is what to send to PUT to take out what is large and sure enough.
    """
    return await systematic_errors(mission, await newest_map(mission, service.maps, patient=False))


@router.put(
    "/systematic-errors",
    operation_id="setSystematicErrors",
    summary="Take out what is always wrong",
    responses=_CHANGE,
)
async def set_systematic_errors(errors: SystematicErrors, operator: Operator, mission: Mission) -> CorrectionsView:
    """Set what is taken out of every depth, at any time: all soundings are corrected anew from their raw values."""
    return await recorrection.set_systematic_errors(mission, errors, operator.name)


@router.delete(
    "/systematic-errors",
    operation_id="deleteSystematicErrors",
    summary="Take nothing out",
    responses=problems("mission-not-found", "invalid-request"),
)
async def delete_systematic_errors(operator: Operator, mission: Mission) -> CorrectionsView:
    """Take no systematic errors out any more."""
    return await recorrection.set_systematic_errors(mission, SystematicErrors(), operator.name)


@router.get(
    "/adjustment",
    operation_id="getAdjustment",
    summary="See how tracks are adjusted",
    responses=problems("mission-not-found", "invalid-request"),
)
async def get_adjustment(reader: Reader, mission: Mission) -> AdjustmentView:
    """Return by how much vehicles' positions are changed for their drift, how sure that is, and every tie."""
    return adjustment.adjustment_view(mission)


@router.post(
    "/adjustment",
    operation_id="adjustTracks",
    summary="Adjust tracks for drift",
    responses=_CHANGE | problems("conflict", "pings-unreadable"),
)
async def adjust_tracks(
    operator: Operator, mission: Mission, request: AdjustmentRequest | None = None
) -> AdjustmentView:
    """Find by how much positions were off, by overlapping soundings and fixes, and place all soundings anew.

    Raw positions stay. Soundings that come later stay where they are until it is done again, which replaces it.
    """
    return await adjustment.adjust(mission, request or AdjustmentRequest(), operator.name)


@router.delete(
    "/adjustment",
    operation_id="undoAdjustment",
    summary="Take positions as they came",
    responses=problems("mission-not-found", "invalid-request"),
)
async def undo_adjustment(operator: Operator, mission: Mission) -> AdjustmentView:
    """Undo the adjustment of tracks."""
    return await adjustment.undo(mission, operator.name)
