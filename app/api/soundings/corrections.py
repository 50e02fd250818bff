"""How soundings are corrected: mounting, tide, sound speed, systematic errors, and the drift of vehicles."""

from contextlib import suppress
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request
from pydantic import Field

from app.api.access.auth import Operator, Reader
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import body_problems, problems
from app.api.http.while_connected import while_connected
from app.api.mission import Mission
from app.api.schemas import API, VehicleName
from app.api.state import Service
from app.mapping.s44 import Order
from app.missions.errors import InvalidRequestError, MapNotReadyError
from app.missions.operations.corrections import adjustment, casts, measured_casts, patch_test, recorrection
from app.missions.operations.corrections.cast_use import casts_view
from app.missions.operations.corrections.recorrection import corrections_view
from app.missions.operations.corrections.systematic_errors import systematic_errors
from app.missions.operations.maps.mission_maps import newest_map
from app.missions.spec.mounting import MountingSpec
from app.missions.spec.systematic_errors import SystematicErrors
from app.missions.spec.water import MOST_NAME, CastDescription, CastRules, NewCasts, SoundSpeed
from app.missions.views.measurements.adjustment import AdjustmentRequest, AdjustmentView
from app.missions.views.measurements.corrections import CastsView, CorrectionsView, TideCorrection, VehicleCastView
from app.missions.views.measurements.mounting_estimate import MountingEstimateRequest, MountingEstimateView
from app.missions.views.measurements.systematic_errors import SystematicErrorsView

router = APIRouter(
    route_class=JsonRoute,
    prefix=f"{API}/missions/{{mission_id}}",
    tags=["maps"],
    responses=problems("unauthenticated", "forbidden"),
)

S44Order = Annotated[Order, Query(description="Order of IHO S-44 that differences between casts are compared with")]
CastName = Annotated[str, Path(min_length=1, max_length=MOST_NAME, description="Name of a sound speed cast")]

VehicleTime = Annotated[float, Field(ge=0, lt=1e11, description="Unix seconds of the vehicle's clock")]

_CHANGE = body_problems("mission-not-found")


@router.get(
    "/corrections",
    operation_id="getCorrections",
    summary="See how soundings are corrected",
    responses=problems("mission-not-found", "invalid-request"),
)
async def get_corrections(reader: Reader, mission: Mission) -> CorrectionsView:
    """Return tide, sound speed, mountings of sonars and the datum that depths are counted from."""
    return corrections_view(mission)


@router.put("/tide", operation_id="setTide", summary="Correct the tide", responses=_CHANGE)
async def set_tide(tide: TideCorrection, operator: Operator, mission: Mission) -> CorrectionsView:
    """Set the water level or a tide table, at any time: every sounding is corrected anew from its raw depth."""
    return await recorrection.set_tide(mission, tide, operator.name)


@router.put("/sound-speed", operation_id="setSoundSpeed", summary="Correct the sound speed", responses=_CHANGE)
async def set_sound_speed(sound_speed: SoundSpeed, operator: Operator, mission: Mission) -> CorrectionsView:
    """Set the measured sound speed, one cast or several, at any time, in place of all casts that there are.

    Every sounding is corrected anew from its raw range.
    """
    return await recorrection.set_sound_speed(mission, sound_speed, operator.name)


@router.delete(
    "/sound-speed",
    operation_id="deleteSoundSpeed",
    summary="Take the sonars' own ranges",
    responses=problems("mission-not-found", "invalid-request"),
)
async def delete_sound_speed(operator: Operator, mission: Mission) -> CorrectionsView:
    """Correct no sound speed any more: all casts are removed."""
    return await recorrection.set_sound_speed(mission, None, operator.name)


@router.get(
    "/sound-speed/casts",
    operation_id="getCasts",
    summary="See what each cast corrects",
    responses=problems("mission-not-found", "invalid-request", "pings-unreadable"),
)
async def get_casts(service: Service, reader: Reader, mission: Mission, order: S44Order = Order.ORDER_1A) -> CastsView:
    """Return the sound speed casts with how many soundings each corrects, and how far away it was taken.

    `changes` tells by how much the depth of the outer beam differs from each cast to the next.
    """
    # Neighbours are compared down to the map's deepest cell; a service that has just begun has no map in memory yet.
    with suppress(MapNotReadyError):
        await newest_map(mission, service.maps, patient=False)
    return await casts_view(mission, order)


@router.get(
    "/sound-speed/measured",
    operation_id="getMeasuredCasts",
    summary="See the sound speed casts that vehicles measured",
    responses=problems("mission-not-found", "invalid-request"),
)
async def get_measured_casts(
    reader: Reader,
    mission: Mission,
    vehicle: Annotated[VehicleName | None, Query(description="Whose; default: of all")] = None,
    from_s: Annotated[VehicleTime | None, Query(description="Of what was measured from then on")] = None,
    until_s: Annotated[VehicleTime | None, Query(description="Of what was measured until then")] = None,
) -> list[VehicleCastView]:
    """Return the casts that vehicles measured, as they sent them and in logs that were imported, oldest first.

    None counts before it is added. Where a log was imported, it stands for what its vehicle sent meanwhile.
    """
    if from_s is not None and until_s is not None and from_s > until_s:
        raise InvalidRequestError("from_s", f"{from_s:g} is after until_s, {until_s:g}", "swap them")
    return await measured_casts.vehicles_casts(mission, vehicle=vehicle, from_s=from_s, until_s=until_s)


@router.post(
    "/sound-speed/casts",
    operation_id="addCasts",
    summary="Add sound speed casts",
    responses=_CHANGE | problems("conflict"),
)
async def add_casts(new: NewCasts, operator: Operator, mission: Mission) -> CorrectionsView:
    """Add the casts of a file to those that there are, at any time, all or none: every sounding is corrected anew.

    What others add meanwhile stays.
    """
    return await casts.add_casts(mission, new, operator.name)


@router.put(
    "/sound-speed/casts/{name}",
    operation_id="setCast",
    summary="Add or replace a sound speed cast",
    responses=_CHANGE,
)
async def set_cast(name: CastName, cast: CastDescription, operator: Operator, mission: Mission) -> CorrectionsView:
    """Add a sound speed cast, or replace the one of this name, at any time: every sounding is corrected anew."""
    return await casts.set_cast(mission, name, cast, operator.name)


@router.delete(
    "/sound-speed/casts/{name}",
    operation_id="deleteCast",
    summary="Remove a sound speed cast",
    responses=problems("mission-not-found", "cast-not-found", "invalid-request"),
)
async def delete_cast(name: CastName, operator: Operator, mission: Mission) -> CorrectionsView:
    """Remove a sound speed cast; without the last one the sonars' own ranges are taken."""
    return await casts.remove_cast(mission, name, operator.name)


@router.put(
    "/sound-speed/rule",
    operation_id="setCastRule",
    summary="Choose sound speed casts by a rule",
    responses=_CHANGE | problems("conflict"),
)
async def set_cast_rule(rules: CastRules, operator: Operator, mission: Mission) -> CorrectionsView:
    """Set which of several casts corrects a ping, at any time: every sounding is corrected anew."""
    return await casts.set_cast_rule(mission, rules, operator.name)


@router.put(
    "/mountings/{name}",
    operation_id="setMounting",
    summary="Correct how a sonar is mounted",
    responses=_CHANGE | problems("vehicle-not-found"),
)
async def set_mounting(
    name: VehicleName, mounting: MountingSpec, operator: Operator, mission: Mission
) -> CorrectionsView:
    """Set how a vehicle's sonar is mounted, as a patch test tells it, at any time, in place of what its vehicle states.

    Every sounding and every beam is placed anew from its raw values. Refused where beams came placed, with a
    multibeam's own files (GSF, KMALL).
    """
    return await recorrection.set_mounting(mission, name, mounting, operator.name)


@router.delete(
    "/mountings/{name}",
    operation_id="deleteMounting",
    summary="Take a sonar as its vehicle states it is mounted",
    responses=problems("mission-not-found", "vehicle-not-found", "invalid-request"),
)
async def delete_mounting(name: VehicleName, operator: Operator, mission: Mission) -> CorrectionsView:
    """Correct the mounting no more: what the vehicle's description states counts again."""
    return await recorrection.set_mounting(mission, name, None, operator.name)


@router.post(
    "/mountings/{name}/estimate",
    operation_id="estimateMounting",
    summary="Estimate how a sonar is mounted",
    response_model=MountingEstimateView,
    responses=body_problems("mission-not-found", "vehicle-not-found", "conflict", "pings-unreadable"),
)
async def estimate_mounting(
    name: VehicleName,
    operator: Operator,
    mission: Mission,
    request: Request,
    wanted: MountingEstimateRequest | None = None,
) -> Any:
    """Evaluate a patch test: find the roll, pitch, heading and latency with which overlapping lines agree best.

    Changes nothing: what is proposed is sent to PUT. What the lines do not tell is named, with the lines that would.
    Takes some seconds, with millions of beams a minute; a client that does not wait any more ends it.
    """
    estimating = patch_test.estimate_mounting(mission, name, wanted or MountingEstimateRequest())
    return await while_connected(request, estimating)


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
