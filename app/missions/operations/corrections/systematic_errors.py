"""What a mission's survey shows of systematic errors, and which of them are proposed to be taken out."""

import asyncio
from collections.abc import Iterable, Mapping

import numpy as np

from app.estimation.systematic import CrossingDepths, Estimate, LevelErrors, SwathTilt, TiltErrors, level_errors
from app.mapping.quality.beams import expected_m
from app.mapping.quality.survey import SurveyCheck
from app.mapping.swath.density import DensityGrid
from app.missions.live.mission import LiveMission
from app.missions.maps.snapshot import MapSnapshot
from app.missions.maps.swath_grid import Beams, beams_of
from app.missions.operations.corrections.crossovers import check_of
from app.missions.soundings.corrections import ASSUMED_MPS
from app.missions.spec.systematic_errors import InstrumentErrors, SystematicErrors
from app.missions.views.measurements.systematic_errors import ErrorKind, SystematicErrorsView, SystematicErrorView

LEAST = {
    ErrorKind.DEPTH: 0.02,
    ErrorKind.WATER_LEVEL: 0.03,
    ErrorKind.ROLL_OFFSET: 0.03,
    ErrorKind.SOUND_SPEED: 0.5,
}
"""Smaller errors are left in, in their units."""

UNITS = {
    ErrorKind.DEPTH: "m",
    ErrorKind.WATER_LEVEL: "m",
    ErrorKind.ROLL_OFFSET: "degrees",
    ErrorKind.SOUND_SPEED: "m/s",
}

SURE, SURE_OF_LEVEL = 3.0, 4.0
"""An error is proposed from so many standard deviations; the largest of many levels is often large by chance."""

BELOW_RAD = np.radians(15.0)
"""Beams nearer to straight down than this tell what lies there: roll and sound speed hardly move their depths."""

ASIDE_RAD = np.radians(20.0)
"""Beams farther from it are compared with that."""

BLOCK_S = 30.0
"""Pings of a vehicle within so many seconds share errors of place and level."""

MOST_BEAMS = 64
"""Of a ping that are looked at."""


async def systematic_errors(live: LiveMission, snapshot: MapSnapshot) -> SystematicErrorsView:
    """Return what lines that cross, and swaths that overlap, show. Raises PingsUnreadableError."""
    check = (await check_of(live, snapshot)).check
    levels = await asyncio.to_thread(_levels, check)
    tilts = await _tilts(live, levels, check) if live.counts.pings else {}
    assumed_mps = ASSUMED_MPS if live.spec.sound_speed is None else live.spec.sound_speed.assumed_mps
    errors = [*_of_levels(levels, check.names), *_of_swaths(tilts, assumed_mps)]
    return SystematicErrorsView(
        applied=live.spec.systematic_errors,
        errors=errors,
        unknown=list(_unknown(live, check, levels, tilts)),
        proposal=_proposal(live.spec.systematic_errors, errors, levels),
    )


def _levels(check: SurveyCheck) -> LevelErrors | None:
    found = check.crossings
    line = found.line
    return level_errors(CrossingDepths(check.lines.vehicle[line], line, found.time_s, found.difference_m))


async def _tilts(live: LiveMission, levels: LevelErrors | None, check: SurveyCheck) -> dict[str, TiltErrors]:
    """Return what is wrong with each swath: pings are read twice, for what lies straight down and to compare."""
    until = await live.pings.newest_block()
    below = DensityGrid(live.builder.grid, live.builder.mask)
    offsets = {} if levels is None else {check.names[number]: one.value for number, one in levels.offsets.items()}
    uncertainty = live.spec.uncertainty

    def lay(vehicle: str, beams: Beams) -> None:
        at = beams.footprints
        near = np.abs(at.angle_rad) <= BELOW_RAD
        depth_m = at.depth_m[near] - offsets.get(vehicle, 0.0)
        below.add(at.east_m[near], at.north_m[near], depth_m, beams.sd_m[near])

    place = live.gate.corrections.placing()
    async for vehicle, pings in live.pings.all_accepted(until):
        beams = await asyncio.to_thread(beams_of, vehicle, pings, place, uncertainty)
        if beams is not None:
            await asyncio.to_thread(lay, vehicle, beams)
    tilt, known_m = SwathTilt(), below.depth_m

    def compare(vehicle: str, beams: Beams) -> None:
        pings, at = beams.pings, beams.footprints
        every = max(1, len(at) // max(1, len(pings) * MOST_BEAMS))
        rows = np.flatnonzero(np.abs(at.angle_rad) >= ASIDE_RAD)[::every]
        at = at.take(rows)
        off_m = at.depth_m - offsets.get(vehicle, 0.0) - expected_m(live.builder.grid, known_m, at.east_m, at.north_m)
        block = np.floor(pings.time_s[at.ping] / BLOCK_S).astype(np.int64)
        height_m = at.depth_m - pings.depth_m[at.ping]
        tilt.add(vehicle, block, at.angle_rad, pings.roll_rad[at.ping], height_m, off_m)

    place = live.gate.corrections.placing()
    async for vehicle, pings in live.pings.all_accepted(until):
        beams = await asyncio.to_thread(beams_of, vehicle, pings, place, uncertainty)
        if beams is not None:
            await asyncio.to_thread(compare, vehicle, beams)
    return {str(vehicle): found for vehicle, found in (await asyncio.to_thread(tilt.errors)).items()}


def _of_levels(levels: LevelErrors | None, names: tuple[str, ...]) -> list[SystematicErrorView]:
    if levels is None:
        return []
    rms = (levels.rms_before_m, levels.rms_after_m)
    found = [_view(ErrorKind.DEPTH, names[number], one, 1.0, rms) for number, one in levels.offsets.items()]
    return found + ([_view(ErrorKind.WATER_LEVEL, None, levels.level, 1.0, rms)] if levels.level else [])


def _of_swaths(tilts: Mapping[str, TiltErrors], assumed_mps: float) -> list[SystematicErrorView]:
    found = []
    for vehicle, tilt in tilts.items():
        rms = (tilt.rms_before_m, tilt.rms_after_m)
        found.append(_view(ErrorKind.ROLL_OFFSET, vehicle, tilt.roll_offset_rad, float(np.degrees(1.0)), rms))
        found.append(_view(ErrorKind.SOUND_SPEED, vehicle, tilt.sound_speed, assumed_mps, rms))
    return found


def _view(
    kind: ErrorKind, vehicle: str | None, found: Estimate, scale: float, rms: tuple[float, float]
) -> SystematicErrorView:
    """Return an error in its unit, ``scale`` times the estimate, and whether it is proposed."""
    value, sd = scale * found.value, scale * found.sd
    sure = SURE_OF_LEVEL if kind is ErrorKind.WATER_LEVEL else SURE
    if abs(value) < LEAST[kind]:
        proposed, why = False, f"less than {LEAST[kind]:g} {UNITS[kind]}"
    elif found.significance < sure:
        proposed, why = False, f"{found.significance:.1f} standard deviations from zero, {sure:g} are asked for"
    elif rms[1] >= rms[0]:
        proposed, why = False, "without it lines would agree no better"
    else:
        proposed = True
        why = (
            f"{found.significance:.1f} standard deviations from zero; without it differences of {rms[0]:.3f} m RMS "
            f"become {rms[1]:.3f} m"
        )
    return SystematicErrorView(
        kind=kind,
        vehicle=vehicle,
        unit=UNITS[kind],
        found=value,
        sd=sd,
        significance=found.significance,
        observations=found.observations,
        rms_before_m=rms[0],
        rms_after_m=rms[1],
        proposed=proposed,
        why=why,
    )


def _unknown(
    live: LiveMission, check: SurveyCheck, levels: LevelErrors | None, tilts: Mapping[str, TiltErrors]
) -> Iterable[str]:
    """Yield what cannot be told, and why."""
    compared = set() if levels is None else {check.names[number] for number in levels.offsets}
    for name in check.names:
        if name not in compared:
            yield f"depth of {name}: it crosses other vehicles' lines too seldom to be compared with them"
    if levels is None or levels.level is None:
        yield "water level: it takes lines that cross others half an hour later, in a survey of an hour or more"
    swaths = {vehicle.name for vehicle in live.spec.vehicles if vehicle.sonar is not None}
    for name in sorted(swaths - set(tilts)):
        yield f"roll and sound speed of {name}: its swaths lie too seldom over what others sounded straight down"


def _proposal(
    applied: SystematicErrors, errors: list[SystematicErrorView], levels: LevelErrors | None
) -> SystematicErrors | None:
    """Return what is applied with what is proposed added; None where nothing is."""
    proposed = [error for error in errors if error.proposed]
    if not proposed:
        return None
    vehicles = dict(applied.vehicles)
    fields = {
        ErrorKind.DEPTH: "depth_m",
        ErrorKind.ROLL_OFFSET: "roll_offset_deg",
        ErrorKind.SOUND_SPEED: "sound_speed_mps",
    }
    for error in proposed:
        if error.vehicle is not None:
            before = vehicles.get(error.vehicle, InstrumentErrors())
            name = fields[error.kind]
            changed = {name: round(getattr(before, name) + error.found, 4)}
            vehicles[error.vehicle] = before.model_copy(update=changed)
    water_level = applied.water_level
    if levels is not None and any(error.kind is ErrorKind.WATER_LEVEL for error in proposed):
        water_level = _sum_of(applied.water_level, levels)
    return SystematicErrors(vehicles=vehicles, water_level=water_level, source="lines of this survey that cross")


def _sum_of(applied: list[tuple[float, float]], levels: LevelErrors) -> list[tuple[float, float]]:
    """Return what is applied and what was found together, with the nodes of both."""
    nodes = np.unique(np.concatenate([levels.node_s, [time_s for time_s, _ in applied]]))
    total = np.interp(nodes, levels.node_s, levels.level_m)
    if applied:
        before = np.array(applied)
        total = total + np.interp(nodes, before[:, 0], before[:, 1])
    return [(round(float(node), 1), round(float(level), 4)) for node, level in zip(nodes, total, strict=True)]
