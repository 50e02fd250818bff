"""Adjusting a mission's tracks for their drift: what overlaps is compared, and every sounding is placed anew."""

import asyncio
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from sqlalchemy.ext.asyncio import AsyncSession

from app.arrays import FloatArray
from app.estimation.adjustment import AdjustedTracks, DriftModel, Fixes, TrackSoundings, adjusted, thinned
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.quality.clock_sessions import set_back_s
from app.missions.clock import now
from app.missions.errors import ConflictError
from app.missions.live.mission import LiveMission
from app.missions.maps.swath_grid import Place, beams_of
from app.missions.operations.corrections.fixes import in_order, jumps, sent_fixes
from app.missions.operations.corrections.recorrection import recorrect
from app.missions.soundings.adjustment import TrackAdjustment
from app.missions.soundings.corrections import Corrections
from app.missions.views.measurements.adjustment import (
    AdjustmentRequest,
    AdjustmentView,
    FixRequest,
    HeldOutView,
    TieFeaturesView,
    TieFeatureView,
    TieView,
    TrackOffsetView,
)
from app.missions.views.measurements.crossovers import PointView
from app.missions.views.mission import Level
from app.storage.bulk import read_in_pieces
from app.storage.models import AdjustmentRow
from app.storage.queries import missions as mission_queries
from app.storage.queries import soundings as sounding_queries

Places = dict[str, list[FloatArray]]
"""By vehicle positions (n, 4) by its own reckoning: time, east, north, depth (NaN: unknown)."""

FINEST_M = 0.5
PERIOD_S = 5.0
"""What a vehicle sounds in a square within this time is taken as one."""

MOST_BEAMS = 64
"""Of a ping with more beams so many are compared, evenly chosen."""

REACH_M = 8.0
FEWEST = 50
"""Soundings that there have to be."""


def adjustment_view(live: LiveMission) -> AdjustmentView:
    """Return by how much a mission's tracks are changed, and how that was found."""
    adjustment = live.gate.corrections.adjustment
    if adjustment is not None:
        return AdjustmentView.model_validate(adjustment.found)
    return AdjustmentView(
        applied=False,
        made_at=None,
        actor=None,
        by_ties=False,
        fixes=0,
        tracks=[],
        ties_used=0,
        ties_rejected=0,
        before_m=None,
        after_m=None,
        held_out=None,
        ties=TieFeaturesView(type="FeatureCollection", features=[]),
    )


async def adjust(live: LiveMission, request: AdjustmentRequest, actor: str) -> AdjustmentView:
    """Find by how much the vehicles' positions were off, and apply it in place of what was applied before.

    Without a fix, and where ties do not tell enough, nothing is moved and nothing applied.

    Raises
    ------
    ConflictError
        When there are too few soundings, or a vehicle's clock was set back, so that two ways have the same times.
    InvalidRequestError
        When nothing is known of a vehicle at the time of a fix.
    PingsUnreadableError
    """
    await live.journal.flush()
    async with live.correcting:
        names, soundings, places = await _soundings(live)
        if len(soundings) < FEWEST:
            raise ConflictError(
                f"there are {len(soundings)} places with accepted soundings", f"tracks are adjusted from {FEWEST} on"
            )
        await asyncio.to_thread(_refuse_set_back, places)
        told = await _positions(live)
        fixes = await asyncio.to_thread(_fixes, request.fixes, told, places, names, live.frame)
        model = DriftModel(walk_m=request.walk_m, rate_mph=request.rate_mph)
        found = await (asyncio.to_thread if live.compute is None else live.compute.run)(
            adjusted, soundings, fixes, model, cell_m=max(FINEST_M, live.spec.cell_m), reach_m=REACH_M
        )
        view = await asyncio.to_thread(_view, found, names, len(fixes), live.frame, actor)
        nodes = {name: _nodes(found, number) for number, name in enumerate(names)}
        adjustment = TrackAdjustment(nodes, view.model_dump(mode="json")) if view.applied else None
        if adjustment is not None or live.gate.corrections.adjustment is not None:
            await _apply(live, adjustment, actor)
    message = f"the tracks' adjustment, asked for by {actor}, moved nothing: no fix is known, and no tie tells enough"
    if view.applied:
        how = f"{view.ties_used} ties and {view.fixes} fixes" if view.by_ties else f"{view.fixes} fixes alone"
        most = max(track.max_m for track in view.tracks)
        message = f"tracks adjusted by {how}, by {most:.1f} m at most, asked for by {actor}"
    await live.journal.log(Level.INFO, "corrections", message, actor=actor)
    return view


async def undo(live: LiveMission, actor: str) -> AdjustmentView:
    """Take positions as they came again."""
    async with live.correcting:
        if live.gate.corrections.adjustment is None:
            return adjustment_view(live)
        await _apply(live, None, actor)
    await live.journal.log(Level.INFO, "corrections", f"the tracks' adjustment was undone by {actor}", actor=actor)
    return adjustment_view(live)


async def _apply(live: LiveMission, adjustment: TrackAdjustment | None, actor: str) -> None:
    """Place every sounding anew, and store by what, in place of what was applied before."""

    async def store(session: AsyncSession) -> None:
        known = await session.get(AdjustmentRow, live.id)
        if known is not None:
            await session.delete(known)
            await session.flush()
        if adjustment is not None:
            session.add(AdjustmentRow(mission_id=live.id, made_at=now(), actor=actor, content=adjustment.pack()))

    await recorrect(live, live.spec, live.gate.corrections.table, adjustment, store)


async def _soundings(live: LiveMission) -> tuple[list[str], TrackSoundings, Places]:
    """Return the vehicles, what they sounded by their own positions, thinned, and where they took themselves to be."""
    before = live.gate.corrections
    cell_m = max(FINEST_M, live.spec.cell_m)
    names: list[str] = []
    parts: list[TrackSoundings] = []
    places: Places = {}

    def number_of(name: str) -> int:
        if name not in names:
            names.append(name)
        return names.index(name)

    def take(rows: Sequence[Any]) -> None:
        of = np.array([row[0] for row in rows])
        values = np.array([tuple(row)[1:] for row in rows], dtype=float)
        for name in np.unique(of).tolist():
            own = values[of == name]
            off = np.zeros((len(own), 2)) if before.adjustment is None else before.adjustment.offsets(name, own[:, 0])
            parts.append(_thinned(number_of(name), own, off, cell_m))
            below = own[:, 1:3] + off
            places.setdefault(name, []).append(np.column_stack([own[:, 0], below, np.full(len(own), np.nan)]))

    await read_in_pieces(live.database, sounding_queries.track_query(live.id), take)
    # As they would be placed without an adjustment.
    place = Corrections.of(
        live.spec, live.frame, before.table, None, live.corrections.stated_mountings, before.rulings
    ).placing()
    async for vehicle, pings in live.pings.all_accepted(await live.pings.newest_block()):
        found = await asyncio.to_thread(_of_pings, live, vehicle, number_of(vehicle), pings, place, cell_m)
        if found is not None:
            parts.append(found)
            east, north = live.frame.to_local(pings.lat_deg, pings.lon_deg)
            places.setdefault(vehicle, []).append(np.column_stack([pings.time_s, east, north, pings.depth_m]))
    # Pieces were cut anywhere: what one vehicle sounded in one place is joined once more.
    joined = await asyncio.to_thread(lambda: thinned(TrackSoundings.joined(parts), cell_m, PERIOD_S))
    return names, joined, places


def _refuse_set_back(places: Places) -> None:
    """Raise ConflictError where two ways of a vehicle have the same times: what belongs to which is not known."""
    for name, parts in places.items():
        back_s = set_back_s(*np.concatenate(parts)[:, :3].T)
        if back_s:
            raise ConflictError(
                f"the clock of {name} was set back by {back_s:.0f} s: two of its ways have the same times, and an "
                "adjustment goes by time",
                "leave the tracks as they are, or import one of the two ways into a mission of its own",
            )


def _of_pings(
    live: LiveMission, vehicle: str, number: int, pings: Any, place: Place, cell_m: float
) -> TrackSoundings | None:
    beams = beams_of(vehicle, pings, place, live.spec.uncertainty)
    if beams is None or not len(beams.footprints):
        return None
    every = slice(None, None, max(1, pings.angle_rad.shape[1] // MOST_BEAMS))
    at = beams.footprints
    columns = (pings.time_s[at.ping], at.east_m, at.north_m, at.depth_m, beams.uncertainty.scattered_sd_m)
    table = np.column_stack(columns)[every]
    return _thinned(number, table, np.zeros((len(table), 2)), cell_m)


def _thinned(number: int, table: FloatArray, off: FloatArray, cell_m: float) -> TrackSoundings:
    """Return soundings (n, 5), whose places were adjusted by something (n, 2), by the vehicle's own positions."""
    time_s, east, north, depth, sd = table.T
    vehicle = np.full(len(table), number, dtype=np.int64)
    raw = TrackSoundings(vehicle, time_s, east + off[:, 0], north + off[:, 1], depth, np.maximum(sd, 1e-3))
    return thinned(raw, cell_m, PERIOD_S)


async def _positions(live: LiveMission) -> Places:
    """Return by vehicle the positions (n, 4) that are stored of its track."""
    found: Places = {}

    def take(rows: Sequence[Any]) -> None:
        of = np.array([row[1] for row in rows])
        values = np.array([tuple(row)[3:7] for row in rows], dtype=float)
        for name in np.unique(of).tolist():
            own = values[of == name]
            east, north = live.frame.to_local(own[:, 2], own[:, 1])
            found.setdefault(name, []).append(np.column_stack([own[:, 0], east, north, own[:, 3]]))

    await read_in_pieces(live.database, mission_queries.positions_after(live.id, 0), take)
    return found


def _fixes(asked: Sequence[FixRequest], told: Places, sounded: Places, names: list[str], frame: LocalFrame) -> Fixes:
    """Return the fixes that were sent, and the jumps of a vehicle's positions where none was.

    ``told`` are the positions that are stored of tracks, ``sounded`` the places where vehicles sounded.
    """
    tracks = {name: in_order(parts) for name, parts in told.items()}
    places = {name: in_order(sounded[name]) for name in names}
    rows = [(names.index(fix.vehicle), *row) for fix, row in sent_fixes(asked, tracks, places, frame)]
    for name in set(names) - {fix.vehicle for fix in asked}:
        rows += [(names.index(name), *row) for row in jumps(tracks.get(name, places[name]))]
    if not rows:
        return Fixes.none()
    rows.sort(key=lambda row: row[:2])
    columns = np.array([row[1:5] for row in rows])
    return Fixes(
        vehicle=np.array([row[0] for row in rows], dtype=np.int64),
        time_s=columns[:, 0],
        east_m=columns[:, 1],
        north_m=columns[:, 2],
        sd_m=columns[:, 3],
        resets=np.array([row[5] for row in rows], dtype=bool),
    )


def _nodes(found: AdjustedTracks, number: int) -> FloatArray:
    own = found.nodes.vehicle == number
    return np.column_stack([found.nodes.time_s[own], found.offset_m[own]])


def _view(found: AdjustedTracks, names: list[str], fixes: int, frame: LocalFrame, actor: str) -> AdjustmentView:
    tracks = []
    for number, name in enumerate(names):
        own = found.nodes.vehicle == number
        size = np.hypot(*found.offset_m[own].T)
        tracks.append(
            TrackOffsetView(
                vehicle=name,
                nodes=int(own.sum()),
                mean_m=float(size.mean()),
                max_m=float(size.max()),
                before_sd_m=float(found.before_sd_m[own].max()),
                sd_m=float(found.sd_m[own].max()),
            )
        )
    lat, lon = frame.to_geographic(
        np.array([tie.east_m for tie in found.ties]), np.array([tie.north_m for tie in found.ties])
    )
    features = []
    for k, tie in enumerate(found.ties):
        shown = TieView(
            number=k + 1,
            vehicle=names[tie.vehicle],
            time_s=tie.time_s,
            other=None if tie.others is None else names[tie.others],
            outcome=tie.outcome.value,
            before_m=_known(tie.before_m),
            after_m=_known(tie.after_m),
            sd_m=(_known(tie.sd_m[0]), _known(tie.sd_m[1])),
        )
        point = PointView(type="Point", coordinates=(round(float(lon[k]), 8), round(float(lat[k]), 8)))
        features.append(TieFeatureView(type="Feature", properties=shown, geometry=point))
    used = [tie for tie in found.ties if tie.outcome == "used"]
    both = [tie for tie in found.ties if math.isfinite(tie.before_m) and math.isfinite(tie.after_m)]
    held = found.held_out
    applied = found.by_ties or fixes > 0
    return AdjustmentView(
        applied=applied,
        made_at=now() if applied else None,
        actor=actor if applied else None,
        by_ties=found.by_ties,
        fixes=fixes,
        tracks=tracks,
        ties_used=len(used),
        ties_rejected=len(found.ties) - len(used),
        before_m=_rms([tie.before_m for tie in both]),
        after_m=_rms([tie.after_m for tie in both]),
        held_out=None
        if held is None
        else HeldOutView(
            sections=held.sections,
            before_m=held.before_m,
            by_fixes_m=held.by_fixes_m,
            after_m=held.after_m,
            significance=held.significance,
        ),
        ties=TieFeaturesView(type="FeatureCollection", features=features),
    )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _rms(values: list[float]) -> float | None:
    return math.sqrt(sum(value**2 for value in values) / len(values)) if values else None
