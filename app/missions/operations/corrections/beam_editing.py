"""Beams of swath sonars as points, and an operator's word on any of them: they count, or they do not."""

import asyncio
from collections import defaultdict
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon
from sqlalchemy import delete
from sqlalchemy.ext.asyncio import AsyncSession

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.swath.pings import Pings, PlacedPings
from app.mapping.swath.rulings import BeamSet, joined
from app.mapping.swath.spikes import states_of
from app.missions.clock import now
from app.missions.errors import BeamEditNotFoundError, ConflictError, InvalidRequestError
from app.missions.live.mission import LiveMission
from app.missions.soundings.beam_edits import BeamEdit, rulings_of
from app.missions.views.measurements.beams import (
    BeamEditsView,
    BeamEditView,
    BeamPoints,
    BeamRulingRequest,
    BeamSelection,
    NamedBeams,
)
from app.missions.views.measurements.soundings import Ruling, SoundingState
from app.missions.views.mission import Level
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.models import BeamEditRow
from app.storage.queries import stored_maps

MOST_PINGS = 1_000_000
"""Pings that one edit may touch: more than two days of one sonar."""

STATES = (SoundingState.USED, SoundingState.DOUBTED, SoundingState.WITHDRAWN, SoundingState.RESTORED)

BESIDE = 2
"""Pings to either side of a beam's own that tell whether it is a spike."""


async def beam_points(live: LiveMission, selection: BeamSelection, limit: int) -> BeamPoints:
    """Return the beams of a selection, as they are placed now, and what became of each.

    Raises ConflictError where no swath sonar has measured, InvalidRequestError where its area is far away,
    PingsUnreadableError.
    """
    points = _Points(live, limit)
    await _select(live, selection, _area_of(live, selection, "area"), points.take)
    return await live.in_background(points.view)


async def rule_beams(live: LiveMission, request: BeamRulingRequest, ruling: Ruling, actor: str) -> BeamEditView:
    """Reject beams or restore them. Raw values stay, and pings that come later are not concerned.

    Raises
    ------
    ConflictError
        Where there are no such beams, or too many.
    InvalidRequestError
        Where the area of the selection is far away.
    PingsUnreadableError
    """
    if request.selection is not None:
        chosen = _Chosen()
        area = _area_of(live, request.selection, "selection.area")
        await _select(live, request.selection, area, chosen.take)
        beams = await live.in_background(chosen.by_vehicle)
    else:
        beams = await _named(live, request.pings)
    if not beams:
        raise ConflictError("no beam is there", "look which there are: POST /api/v1/missions/{id}/beams/points")
    selection = None if request.selection is None else request.selection.model_dump(mode="json", exclude_none=True)
    edit = BeamEdit(ruling, beams, selection, now(), actor, request.note)
    row = await live.in_background(edit.row, live.id)

    async def store(session: AsyncSession) -> Mapping[int, BeamEdit]:
        session.add(row)
        await session.flush()
        return {**live.corrections.beam_edits, row.id: edit}

    await _change(live, store)
    view = _view(row.id, edit)
    said = f": {request.note}" if request.note else ""
    what = "beam" if view.beams == 1 else "beams"
    words = f"{view.beams} {what} of {', '.join(view.vehicles)} {ruling} by {actor}{said}"
    await live.journal.log(Level.INFO, "sounding", words, actor=actor, edit=row.id)
    return view


def beam_edits(live: LiveMission) -> BeamEditsView:
    """Return all that was said of a mission's beams."""
    rulings = live.gate.corrections.rulings
    return BeamEditsView(
        rejected=rulings.rejected_beams,
        restored=rulings.restored_beams,
        edits=[_view(number, edit) for number, edit in live.corrections.beam_edits.items()],
    )


async def withdraw_edit(live: LiveMission, number: int, actor: str) -> BeamEditsView:
    """Take back what was once said of some beams: what was said of them before counts again.

    Raises BeamEditNotFoundError.
    """
    edit = live.corrections.beam_edits.get(number)

    async def store(session: AsyncSession) -> Mapping[int, BeamEdit]:
        if edit is None or number not in live.corrections.beam_edits:
            raise BeamEditNotFoundError(
                f"there is no edit {number} of beams in this mission",
                "GET /api/v1/missions/{id}/beams/edits lists them",
            )
        await session.execute(delete(BeamEditRow).where(BeamEditRow.id == number))
        return {other: one for other, one in live.corrections.beam_edits.items() if other != number}

    await _change(live, store)
    words = f"edit {number} of beams ({edit.ruling if edit else ''}) is taken back by {actor}"
    await live.journal.log(Level.INFO, "sounding", words, actor=actor, edit=number)
    return beam_edits(live)


async def _change(live: LiveMission, store: Callable[[AsyncSession], Awaitable[Mapping[int, BeamEdit]]]) -> None:
    """Change what is said of beams; ``store`` writes it, and returns what is said from then on."""

    async def commit() -> None:
        async with live.database.writing() as session:
            edits = await store(session)
            await stored_maps.forget(session, live.id)
        # Of millions of beams it takes long to tell what counts.
        live.edit_beams(edits, await live.in_background(rulings_of, edits))

    async with live.correcting, live.journal.writing:
        await to_the_end(commit())
    live.changed.set()
    live.publish_summary()


def _view(number: int, edit: BeamEdit) -> BeamEditView:
    return BeamEditView(
        id=number,
        ruling=edit.ruling,
        beams=sum(len(one) for one in edit.beams.values()),
        vehicles=list(edit.beams),
        selection=None if edit.selection is None else BeamSelection.model_validate(edit.selection),
        made_at=edit.made_at,
        actor=edit.actor,
        note=edit.note,
    )


@dataclass(frozen=True)
class _Found:
    """Footprints (k,) of some pings that are of a selection: ``row`` of the ping, place of the beam in it."""

    vehicle: str
    there: PlacedPings
    footprint: IntArray
    row: IntArray
    beam: IntArray


def _area_of(live: LiveMission, selection: BeamSelection, field: str) -> Polygon | None:
    """Return the area of a selection in the mission's frame. Raises InvalidRequestError, naming the ``field``."""
    if selection.area is None:
        return None
    try:
        area = Polygon(live.spec.to_local(selection.area))
    except ValueError as error:
        words, _, advice = str(error).rpartition(": ")
        raise InvalidRequestError(field, f"it is far from the mission: {words}", advice) from error
    shapely.prepare(area)
    return area


async def _select(
    live: LiveMission, selection: BeamSelection, area: Polygon | None, take: Callable[[_Found], None]
) -> None:
    """Look through all accepted pings for the beams of a selection; ``take`` runs in threads, once for some pings."""
    # Each looks at all beams, in the threads that make maps.
    async with live.part(_Turn).taken:
        await _look_through(live, selection, area, take)


class _Turn:
    """The beams of a mission are looked through once at a time."""

    def __init__(self, _live: LiveMission) -> None:
        self.taken = asyncio.Lock()


async def _look_through(
    live: LiveMission, selection: BeamSelection, area: Polygon | None, take: Callable[[_Found], None]
) -> None:
    await live.journal.flush()
    until = await live.pings.newest_block()
    place = live.gate.corrections.placing()
    swath = False

    def look(vehicle: str, pings: Pings) -> None:
        there = place(vehicle, pings)
        if there is not None:
            found = _of_selection(vehicle, there, selection, area)
            if len(found.footprint):
                take(found)

    async for vehicle, pings in live.pings.all_accepted(until):
        swath = True
        if selection.vehicle in (None, vehicle):
            await live.in_background(look, vehicle, pings)
    if not swath:
        raise ConflictError(
            "no swath sonar has measured in this mission", "soundings of single beams are under soundings"
        )


def _of_selection(vehicle: str, there: PlacedPings, selection: BeamSelection, area: Polygon | None) -> _Found:
    pings, at = there.pings, there.footprints
    wanted = np.isfinite(at.depth_m)
    with np.errstate(invalid="ignore"):
        for low, high, values in (
            (selection.least_depth_m, selection.most_depth_m, at.depth_m),
            (selection.from_s, selection.until_s, pings.time_s[at.ping]),
        ):
            wanted &= (values >= (-np.inf if low is None else low)) & (values <= (np.inf if high is None else high))
    if selection.least_angle_deg is not None:
        wanted &= np.abs(at.angle_rad) >= np.radians(selection.least_angle_deg)
    if area is not None:
        west, south, east, north = area.bounds
        wanted &= (at.east_m >= west) & (at.east_m <= east) & (at.north_m >= south) & (at.north_m <= north)
        near = np.flatnonzero(wanted)
        wanted[near] = shapely.contains_xy(area, at.east_m[near], at.north_m[near])
    row, beam = np.nonzero(np.isfinite(pings.range_m) & np.isfinite(pings.angle_rad))
    footprint = np.flatnonzero(wanted)
    return _Found(vehicle, there, footprint, row[footprint], beam[footprint])


class _Chosen:
    """The beams of a selection, by vehicle."""

    def __init__(self) -> None:
        self._parts: defaultdict[str, list[BeamSet]] = defaultdict(list)
        self._pings = 0

    def take(self, found: _Found) -> None:
        """Take some in. Raises ConflictError where it is too many."""
        pings = found.there.pings
        chosen = np.zeros(pings.range_m.shape, dtype=np.bool_)
        chosen[found.row, found.beam] = True
        part = BeamSet.of(pings.time_s, chosen)
        self._pings += len(part.time_s)
        if self._pings > MOST_PINGS:
            raise ConflictError(
                f"these are beams of more than {MOST_PINGS} pings", "choose fewer: state an area, or times"
            )
        self._parts[found.vehicle].append(part)

    def by_vehicle(self) -> dict[str, BeamSet]:
        """Return all of them."""
        return {vehicle: joined(self._parts[vehicle]) for vehicle in sorted(self._parts)}


async def _named(live: LiveMission, pings: Sequence[NamedBeams]) -> dict[str, BeamSet]:
    """Return the beams that are named. Raises ConflictError where one of them is not there."""
    wanted: defaultdict[str, dict[float, set[int]]] = defaultdict(dict)
    for one in pings:
        wanted[one.vehicle].setdefault(one.time_s, set()).update(one.beams)

    def asked(vehicle: str) -> BeamSet:
        own = wanted[vehicle]
        wide = 1 + max(max(beams) for beams in own.values())
        chosen = np.zeros((len(own), wide), dtype=np.bool_)
        for row, beams in enumerate(own.values()):
            chosen[row, list(beams)] = True
        return BeamSet.of(np.array(list(own)), chosen)

    sets = {vehicle: await live.in_background(asked, vehicle) for vehicle in sorted(wanted)}
    there: dict[str, int] = dict.fromkeys(sets, 0)

    def count(vehicle: str, pings: Pings) -> None:
        met = np.isfinite(pings.range_m) & np.isfinite(pings.angle_rad)
        there[vehicle] += int((sets[vehicle].among(pings.time_s, met.shape[1]) & met).sum())

    await live.journal.flush()
    async for vehicle, some in live.pings.all_accepted(await live.pings.newest_block()):
        if vehicle in sets:
            await live.in_background(count, vehicle, some)
    for vehicle, beams in sets.items():
        missing = len(beams) - there[vehicle]
        if missing:
            raise ConflictError(
                f"{missing} of {len(beams)} beams of {vehicle} are not there, or met nothing",
                "take times and beams from POST /api/v1/missions/{id}/beams/points as they are",
            )
    return sets


class _Points:
    """Beams as points, of every ping or of some of them, so that there are not too many."""

    def __init__(self, live: LiveMission, limit: int) -> None:
        self._frame, self._limit = live.frame, limit
        self._total, self._every, self._pings = 0, 1, 0
        self._vehicles: list[str] = []
        self._parts: list[FloatArray] = []
        """Number of the ping, its vehicle and time, place of the beam, east, north, depth, state: (n, 8) each."""

    def take(self, found: _Found) -> None:
        """Take some in."""
        if found.vehicle not in self._vehicles:
            self._vehicles.append(found.vehicle)
        there, at = found.there, found.there.footprints.take(found.footprint)
        rows, ping = np.unique(found.row, return_inverse=True)
        columns = (
            self._pings + ping,
            np.full(len(at), self._vehicles.index(found.vehicle)),
            there.pings.time_s[at.ping],
            found.beam,
            at.east_m,
            at.north_m,
            at.depth_m,
            _states(found),
        )
        self._pings += len(rows)
        self._total += len(at)
        self._parts.append(self._thinned(np.column_stack(columns)))
        while sum(len(part) for part in self._parts) > self._limit:
            if self._every > self._pings:
                # The first ping is left, and has more beams by itself.
                first = np.concatenate(self._parts)
                self._parts = [first[np.linspace(0, len(first) - 1, self._limit).astype(int)]]
                return
            self._every *= 2
            self._parts = [self._thinned(part) for part in self._parts]

    def _thinned(self, part: FloatArray) -> FloatArray:
        return part if self._every == 1 else part[part[:, 0] % self._every == 0]

    def view(self) -> BeamPoints:
        """Return what was taken in."""
        table = np.concatenate([np.zeros((0, 8)), *self._parts])
        _, first, ping = np.unique(table[:, 0], return_index=True, return_inverse=True)
        lat, lon = self._frame.to_geographic(table[:, 4], table[:, 5])
        return BeamPoints.model_construct(
            total=self._total,
            every=self._every,
            lon_deg=np.round(lon, 8).tolist(),
            lat_deg=np.round(lat, 8).tolist(),
            depth_m=np.round(table[:, 6], 3).tolist(),
            state=table[:, 7].astype(int).tolist(),
            ping=ping.tolist(),
            beam=table[:, 3].astype(int).tolist(),
            time_s=table[first, 2].tolist(),
            vehicle=table[first, 1].astype(int).tolist(),
            states=list(STATES),
            vehicles=self._vehicles,
        )


def _states(found: _Found) -> IntArray:
    """Return what became of the beams of a selection, as places in ``STATES``."""
    # Whether beams are spikes is told by their own pings and those beside them: of the others it takes long to tell.
    first, last = max(0, int(found.row.min()) - BESIDE), int(found.row.max()) + BESIDE + 1
    there = found.there
    of_these: BoolArray = (there.footprints.ping >= first) & (there.footprints.ping < last)
    begin = int(np.argmax(of_these))
    near = PlacedPings(
        there.pings.take(slice(first, last)),
        there.footprints.take(of_these),
        None if there.rejected is None else there.rejected[of_these],
        None if there.restored is None else there.restored[of_these],
    )
    states = states_of(near)
    at = found.footprint - begin
    return np.asarray(states.spike[at] + 2 * states.rejected[at] + 3 * states.restored[at], dtype=np.int64)
