"""Soundings, maps and reference grids from elsewhere, for a mission: everything in a file or nothing."""

import asyncio
import hashlib
import math
import uuid
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncSession
from sqlalchemy.orm import defer

from app.mapping.coordinates.distances import METRES_PER_DEGREE
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.kriging.supersoundings import merge_soundings
from app.mapping.quality.depth_offset import offset_between
from app.mapping.readers.file_extensions import drawing_ending, ending
from app.mapping.readers.types import DATUM_NOTE, MapExtent, ReadError, ReadOptions
from app.mapping.types import Grid, SoundingRows, Soundings
from app.mapping.water.vertical import INSTANTANEOUS_WATER_LEVEL
from app.missions.clock import now
from app.missions.errors import ConflictError, ImportNotFoundError, InvalidRequestError
from app.missions.live.mission import LiveMission
from app.missions.operations.imports.drawings import drawing_view
from app.missions.operations.imports.reader_process import ChartedZone, Reader
from app.missions.operations.imports.uploads import Upload
from app.missions.running.final_maps import FinalMaps
from app.missions.spec.base import PolygonGeometry
from app.missions.states import ENDED, NOT_STARTED
from app.missions.views.measurements.imports import (
    DrawingOptions,
    DrawingView,
    ImportOptions,
    ImportView,
    ProposedZonesView,
    ProposedZoneView,
    ReferenceView,
    ZoneOptions,
)
from app.missions.views.mission import Level
from app.storage.bulk import read_in_pieces
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.models import ImportRow, ReferenceRow
from app.storage.queries import soundings as sounding_queries
from app.storage.queries import stored_maps

MAX_SIDE_M = 50_000.0
"""Of an area that a chart is asked for."""

REASONS = {
    "LNDARE": "land",
    "OBSTRN": "obstruction",
    "WRECKS": "wreck",
    "UWTROC": "rock",
    "RESARE": "restricted area",
    "SLCONS": "shoreline construction",
    "PONTON": "pontoon",
    "PILPNT": "pile",
    "OFSPLF": "offshore platform",
    "MORFAC": "mooring",
    "MARCUL": "marine farm",
    "FSHFAC": "fishing facility",
    "HULKES": "hulk",
    "FLODOC": "floating dock",
    "DAMCON": "dam",
    "GATCON": "gate",
}
"""What objects of charts are, in words."""

MAX_PRIOR = 100_000
"""Imported soundings per file that the map takes one by one; where there are more they are merged per cell."""


def kind_of(options: ImportOptions) -> str:
    """Return the ending of a file's name, which says how it is read. Raises InvalidRequestError."""
    try:
        return ending(options.filename)
    except ReadError as error:
        raise InvalidRequestError(error.field, str(error), error.remedy) from None


class Imports:
    """Takes files into missions and out of them again.

    Parameters
    ----------
    reader
        Reads them.
    maps
        Shows at once what was imported; while a mission runs its next step does.
    """

    def __init__(self, reader: Reader, maps: FinalMaps) -> None:
        self._reader = reader
        self._maps = maps
        # Held while something is stored or taken away, not while a file is read.
        self._storing = asyncio.Lock()

    async def add(self, live: LiveMission, upload: Upload, options: ImportOptions, actor: str) -> ImportView:
        """Add the soundings of a file to what is known before a mission measures.

        The same file again changes nothing and gives the first answer.

        Raises
        ------
        InvalidRequestError, ConflictError, ImportUnavailableError
            When the file cannot be used; when the mission has ended, or has the same file with other options; when
            nothing can be read now.
        """
        kind = _checked(upload, options)
        known = await _same_file(live, upload.sha256, options)
        if known is not None:
            return known
        _refuse_ended(live)
        async with self._reader.turn():
            # It may have been taken in while this waited.
            known = await _same_file(live, upload.sha256, options)
            if known is not None:
                return known
            found = await self._reader.read(upload, kind, "soundings", _place(live), _read_options(options))
            kept, merged = await live.in_background(_kept, live, found.values)
            off = await _off_by(live, kept)
            if not len(kept):
                wrong = "none of its depths lies near the mission's area"
                raise InvalidRequestError("file", wrong, "check file and crs")
            notes = [*found.notes, *([f"{merged} soundings were merged per cell of the map"] if merged else []), *off]
            row = ImportRow(
                id=str(uuid.uuid4()),
                mission_id=live.id,
                digest=upload.sha256,
                filename=options.filename,
                count=len(kept),
                summary=options.model_dump(mode="json")
                | {
                    "notes": notes,
                    "found": found.found,
                    "min_depth_m": float(kept[:, 2].min()),
                    "max_depth_m": float(kept[:, 2].max()),
                    "median_sd_m": float(np.median(kept[:, 3])),
                },
                soundings=await asyncio.to_thread(sounding_queries.pack, kept),
            )
            view = await to_the_end(self._store(live, row, kept))
        words = f"{view.taken} prior soundings of {view.filename} imported by {actor}"
        await live.journal.log(Level.INFO, "import", words, actor=actor)
        await _warn(live, view.filename, view.notes, actor)
        return view

    async def _store(self, live: LiveMission, row: ImportRow, kept: NDArray[np.float64]) -> ImportView:
        async with self._storing:
            _refuse_ended(live)
            before = await _imported(live)
            prior = np.concatenate([before, kept])
            row.created_at = now()
            view = _view(row)
            # A map that is stored meanwhile would lack these.
            async with live.journal.writing:
                async with live.database.writing() as session:
                    session.add(row)
                    await session.flush()
                    await stored_maps.forget(session, live.id)
                live.builder.arrivals.replace_prior(prior)
        live.changed.set()
        live.publish_summary()
        self._show(live)
        return view

    async def begin_with(
        self, live: LiveMission, depths: SoundingRows | None, described: Mapping[str, Any] | None = None
    ) -> None:
        """Begin with a site's depths in place of those that were taken before; None: with none of a site.

        Parameters
        ----------
        depths : (n, 4)
            In the mission's frame.
        described
            ``site``, ``source`` and ``notes``, as they are answered.
        """
        async with live.database.reading() as session:
            known = [row for row in await _rows_of(session, live.id) if row.summary.get("site")]
        row = None
        if depths is not None:
            kept, merged = await live.in_background(_kept, live, depths)
            notes = [f"{merged} depths were merged per cell of the map"] if merged else []
            row = await asyncio.to_thread(_row_of_site, live, kept, len(depths), dict(described or {}), notes)
            if [(one.digest, one.summary["notes"]) for one in known] == [(row.digest, row.summary["notes"])]:
                return
        if row is None and not known:
            return
        await to_the_end(self._exchange(live, [one.id for one in known], row))
        self._show(live)
        words = "no depths of a site" if row is None else f"{row.count} depths of {row.filename}"
        await live.journal.log(Level.INFO, "import", f"the mission begins with {words}")

    async def _exchange(self, live: LiveMission, known: Sequence[str], row: ImportRow | None) -> None:
        async with self._storing, live.journal.writing:
            _refuse_ended(live)
            async with live.database.writing() as session:
                for import_id in known:
                    gone = await session.get(ImportRow, import_id)
                    if gone is not None:
                        await session.delete(gone)
                await session.flush()
                if row is not None:
                    row.created_at = now()
                    session.add(row)
                    await session.flush()
                await stored_maps.forget(session, live.id)
            live.builder.arrivals.replace_prior(await _imported(live))
        live.changed.set()
        live.publish_summary()

    def _show(self, live: LiveMission) -> None:
        if not live.running:
            self._maps.take_up(live)

    async def delete(self, live: LiveMission, import_id: str, actor: str) -> None:
        """Take an import back. Raises ImportNotFoundError."""
        filename = await to_the_end(self._take_away(live, import_id))
        self._show(live)
        await live.journal.log(Level.INFO, "import", f"import of {filename} taken back by {actor}", actor=actor)

    async def _take_away(self, live: LiveMission, import_id: str) -> str:
        async with self._storing:
            prior = await _imported(live, without=import_id)
            async with live.journal.writing:
                async with live.database.writing() as session:
                    row = await session.get(ImportRow, import_id)
                    if row is None or row.mission_id != live.id:
                        raise ImportNotFoundError(
                            f"there is no import {import_id!r}", "GET /api/v1/missions/{id}/imports lists them"
                        )
                    if row.summary.get("site") and live.header.state in NOT_STARTED:
                        raise ConflictError(
                            "these are the depths of the mission's site, which it begins with",
                            "create the mission with site_prior false to begin without them",
                        )
                    filename = row.filename
                    await session.delete(row)
                    await session.flush()
                    await stored_maps.forget(session, live.id)
                live.builder.arrivals.replace_prior(prior)
        return filename

    async def propose_zones(self, upload: Upload, options: ZoneOptions) -> ProposedZonesView:
        """Return what an ENC cell shows in an area to keep out of. Nothing is stored, and no mission changes.

        Raises
        ------
        InvalidRequestError, ImportUnavailableError
            When area or file cannot be used, or nothing can be read now.
        """
        place = _extent_of(options)
        if not upload.size_bytes:
            raise InvalidRequestError("file", "it is empty", "send the file's content as the body")
        async with self._reader.turn():
            zones, notes = await self._reader.read_zones(upload, place, options.margin_m)
        shown = [_proposed(zone) for zone in zones]
        return ProposedZonesView(zones=[zone for zone in shown if zone is not None], notes=notes)

    async def read_drawing(self, upload: Upload, options: DrawingOptions) -> DrawingView:
        """Return the lines and areas that a file holds. Nothing is stored, and no mission changes.

        Raises
        ------
        InvalidRequestError, ImportUnavailableError
            When the file cannot be used, or nothing can be read now.
        """
        try:
            kind = drawing_ending(options.filename)
        except ReadError as error:
            raise InvalidRequestError(error.field, str(error), error.remedy) from None
        if not upload.size_bytes:
            raise InvalidRequestError("file", "it is empty", "send the file's content as the body")
        async with self._reader.turn():
            shapes, notes = await self._reader.read_drawings(upload, kind, options.crs)
        return await asyncio.to_thread(drawing_view, shapes, notes, options.margin_m)

    async def set_reference(
        self, live: LiveMission, upload: Upload, options: ImportOptions, actor: str
    ) -> ReferenceView:
        """Compare the mission's map with the grid in a file from now on.

        Raises
        ------
        InvalidRequestError, ImportUnavailableError
            When the file cannot be used, or nothing can be read now.
        """
        kind = _checked(upload, options)
        async with self._reader.turn():
            found = await self._reader.read(upload, kind, "reference", _place(live), _read_options(options))
        depths = found.values
        row = ReferenceRow(
            mission_id=live.id,
            filename=options.filename,
            created_at=now(),
            rows=depths.shape[0],
            cols=depths.shape[1],
            summary=options.model_dump(mode="json") | {"notes": found.notes, "cells": int(np.isfinite(depths).sum())},
            depths=await asyncio.to_thread(sounding_queries.pack, depths),
        )
        view = _reference_view(row)
        async with self._storing:
            async with live.database.writing() as session:
                await _forget_reference(session, live.id)
                session.add(row)
            live.map.show_reference(depths)
        await live.journal.log(Level.INFO, "import", f"reference grid {options.filename} set by {actor}", actor=actor)
        await _warn(live, options.filename, view.notes, actor)
        return view

    async def delete_reference(self, live: LiveMission, actor: str) -> None:
        """Compare with nothing any more. Raises ImportNotFoundError when there was nothing."""
        async with self._storing:
            await reference_of(live)
            async with live.database.writing() as session:
                await _forget_reference(session, live.id)
            live.map.show_reference(None)
        await live.journal.log(Level.INFO, "import", f"reference grid taken away by {actor}", actor=actor)


async def imports_of(live: LiveMission) -> list[ImportView]:
    """Return what was imported, oldest first."""
    async with live.database.reading() as session:
        return [_view(row) for row in await _rows_of(session, live.id)]


async def reference_of(live: LiveMission) -> ReferenceView:
    """Return what the map is compared with. Raises ImportNotFoundError when there is nothing."""
    async with live.database.reading() as session:
        row = await session.get(ReferenceRow, live.id)
    if row is None:
        raise ImportNotFoundError("the mission has no reference grid", "PUT /api/v1/missions/{id}/reference sets one")
    return _reference_view(row)


async def _rows_of(session: AsyncSession, mission_id: str) -> Sequence[ImportRow]:
    query = select(ImportRow).where(ImportRow.mission_id == mission_id).order_by(ImportRow.created_at, ImportRow.id)
    return (await session.scalars(query.options(defer(ImportRow.soundings)))).all()


def _row_of_site(
    live: LiveMission, kept: SoundingRows, found: int, described: dict[str, Any], notes: Sequence[str]
) -> ImportRow:
    content = sounding_queries.pack(kept)
    return ImportRow(
        id=str(uuid.uuid4()),
        mission_id=live.id,
        digest=hashlib.sha256(content).hexdigest(),
        filename=f"site {described['site']}",
        count=len(kept),
        summary=described
        | {
            "notes": [*described["notes"], *notes],
            "found": found,
            "min_depth_m": float(kept[:, 2].min()),
            "max_depth_m": float(kept[:, 2].max()),
            "median_sd_m": float(np.median(kept[:, 3])),
        },
        soundings=content,
    )


def _extent_of(options: ZoneOptions) -> MapExtent:
    """Return an area given by its ends. Raises InvalidRequestError."""
    middle = 0.5 * (options.south_deg + options.north_deg), 0.5 * (options.west_deg + options.east_deg)
    if options.south_deg >= options.north_deg or options.west_deg >= options.east_deg:
        raise InvalidRequestError(
            "area", "it ends before it begins", "give west_deg < east_deg and south_deg < north_deg"
        )
    high_m = METRES_PER_DEGREE * (options.north_deg - options.south_deg)
    wide_m = METRES_PER_DEGREE * (options.east_deg - options.west_deg) * math.cos(math.radians(middle[0]))
    if max(wide_m, high_m) > MAX_SIDE_M:
        raise InvalidRequestError(
            "area", f"it is {max(wide_m, high_m) / 1000:.0f} km wide", f"ask for at most {MAX_SIDE_M / 1000:g} km"
        )
    frame = LocalFrame(*middle)
    east, north = frame.to_local(
        [options.south_deg, options.south_deg, options.north_deg, options.north_deg],
        [options.west_deg, options.east_deg, options.east_deg, options.west_deg],
    )
    wide, high = float(np.ptp(east)), float(np.ptp(north))
    rows, cols = max(math.ceil(high), 1), max(math.ceil(wide), 1)
    return MapExtent(frame, Grid(float(east.min()), float(north.min()), 1.0, rows, cols), 0.0)


def _proposed(zone: ChartedZone) -> ProposedZoneView | None:
    try:
        geometry = PolygonGeometry(coordinates=[zone.ring])
    except ValueError:
        return None  # a sliver that rounding made touch itself
    return ProposedZoneView(
        object=zone.kind,
        reason=REASONS[zone.kind],
        name=zone.name,
        depth_m=zone.depth_m,
        position_m=zone.position_m,
        zone=geometry,
    )


def _checked(upload: Upload, options: ImportOptions) -> str:
    kind = kind_of(options)
    if not upload.size_bytes:
        raise InvalidRequestError("file", "it is empty", "send the file's content as the body")
    return kind


def _refuse_ended(live: LiveMission) -> None:
    if live.header.state in ENDED:
        raise ConflictError(f"the mission is {live.header.state} and takes no more soundings", "create a new mission")


def _place(live: LiveMission) -> MapExtent:
    epsg = live.facts.vertical_datum.epsg
    datum = None if epsg == INSTANTANEOUS_WATER_LEVEL else epsg
    return MapExtent(live.frame, live.builder.grid, live.margin_m, datum)


def _read_options(options: ImportOptions) -> ReadOptions:
    return ReadOptions(**options.model_dump(mode="json", exclude={"filename", "source"}))


async def _warn(live: LiveMission, filename: str, notes: Sequence[str], actor: str) -> None:
    """Say in the mission's log what may be wrong with the depths of a file."""
    for note in notes:
        if note.startswith(DATUM_NOTE):
            await live.journal.log(Level.WARNING, "import", f"{filename}: {note}", actor=actor)


async def _off_by(live: LiveMission, kept: NDArray[np.float64]) -> list[str]:
    """Return a note where imported depths (n, 4) are off from what the mission sounded in the same cells."""
    await live.journal.flush()
    own = [np.zeros((0, 4))]

    def take(rows: Sequence[Any]) -> None:
        own.append(np.array([tuple(row)[:4] for row in rows], dtype=float).reshape(-1, 4))

    if live.counts.accepted:
        await read_in_pieces(live.database, sounding_queries.accepted_query(live.id), take)
    grid = live.builder.grid
    off = await asyncio.to_thread(lambda: offset_between(grid, *map(Soundings.of_rows, (np.concatenate(own), kept))))
    if off is None or not off.is_significant:
        return []
    return [
        f"{DATUM_NOTE}in {off.cells} cells that both know its depths are {off.median_m:+.2f} m beside those sounded "
        f"in the mission (median), where {off.predicted_m:.2f} m is to be expected: check datum_offset_m and tide"
    ]


async def _imported(live: LiveMission, *, without: str = "") -> NDArray[np.float64]:
    """Return what was imported, unpacked aside: that takes a while where it is much."""
    async with live.database.reading() as session:
        stored = await sounding_queries.imported(session, live.id, without=without)
    return await asyncio.to_thread(sounding_queries.unpack_imported, stored)


async def _forget_reference(session: Any, mission_id: str) -> None:
    known = await session.get(ReferenceRow, mission_id)
    if known is not None:
        await session.delete(known)
        await session.flush()


async def _same_file(live: LiveMission, digest: str, options: ImportOptions) -> ImportView | None:
    """Return the answer once given to the same file. Raises ConflictError when it was read otherwise then."""
    async with live.database.reading() as session:
        query = select(ImportRow).where(ImportRow.mission_id == live.id, ImportRow.digest == digest)
        row = (await session.scalars(query)).first()
    if row is None:
        return None
    asked = options.model_dump(mode="json", exclude={"filename", "source"})
    if any((row.summary.get(name) or None) != (value or None) for name, value in asked.items()):
        raise ConflictError(
            f"the same file was imported before, as {row.filename}, with other options",
            f"take that import back first: DELETE /api/v1/missions/{live.id}/imports/{row.id}",
        )
    return _view(row).model_copy(update={"replayed": True})


def _kept(live: LiveMission, table: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    """Return the soundings in or near the area, (n, 4), and how many were merged into them (0: none was)."""
    zone = Polygon(live.area).buffer(live.margin_m)
    shapely.prepare(zone)
    near = table[shapely.contains_xy(zone, table[:, 0], table[:, 1])]
    if len(near) <= MAX_PRIOR:
        return near, 0
    merged, group = merge_soundings(Soundings.of_rows(near), live.spec.cell_m)
    # Errors of one survey belong together: a mean of many is not better known than one of them.
    deviation = np.sqrt(np.bincount(group, near[:, 3] ** 2) / np.bincount(group))
    return np.column_stack([merged.east_m, merged.north_m, merged.depth_m, deviation]), len(near)


def _view(row: ImportRow) -> ImportView:
    return ImportView(
        id=row.id,
        filename=row.filename,
        source=row.summary["source"],
        site=row.summary.get("site"),
        sha256=row.digest,
        created_at=row.created_at,
        found=row.summary["found"],
        taken=row.count,
        min_depth_m=row.summary["min_depth_m"],
        max_depth_m=row.summary["max_depth_m"],
        median_sd_m=row.summary["median_sd_m"],
        notes=row.summary["notes"],
    )


def _reference_view(row: ReferenceRow) -> ReferenceView:
    return ReferenceView(
        filename=row.filename,
        source=row.summary["source"],
        created_at=row.created_at,
        cells=row.summary["cells"],
        notes=row.summary["notes"],
    )
