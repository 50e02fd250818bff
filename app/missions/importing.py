"""Soundings, maps and reference grids from elsewhere, for a mission: everything in a file or nothing."""

import asyncio
import hashlib
import json
import os
import signal
import sys
import tempfile
import uuid
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from sqlalchemy import select

import app
from app.mapping.readers.files import ending
from app.mapping.readers.types import UNUSABLE, ReadError
from app.mapping.supersoundings import merge_soundings
from app.mapping.types import Soundings
from app.missions.clock import now
from app.missions.errors import ConflictError, ImportNotFoundError, InvalidRequestError
from app.missions.import_views import ImportOptions, ImportView, ReferenceView
from app.missions.live import LiveMission
from app.missions.states import ENDED
from app.missions.views import Level
from app.storage import soundings as sounding_queries
from app.storage import stored_maps
from app.storage.models import ImportRow, ReferenceRow
from app.storage.shielding import to_the_end

ROOT = str(Path(app.__file__).resolve().parents[1])
"""Where the reading process finds this program."""

READING_TIMEOUT_S = 180.0
MAX_PRIOR = 100_000
"""Imported soundings per file that the map takes one by one; where there are more they are merged per cell."""


async def imports_of(live: LiveMission) -> list[ImportView]:
    """Return what was imported, oldest first."""
    async with live.database.reading() as session:
        query = select(ImportRow).where(ImportRow.mission_id == live.id).order_by(ImportRow.created_at, ImportRow.id)
        return [_view(row) for row in await session.scalars(query)]


async def import_soundings(
    live: LiveMission, executor: Executor, content: bytes, options: ImportOptions, actor: str
) -> ImportView:
    """Add the soundings of a file to what is known before a mission measures.

    The same file again changes nothing and gives the first answer.

    Raises
    ------
    InvalidRequestError, ConflictError
        When the file cannot be used; when the mission has ended, or has the same file with other options.
    """
    digest = hashlib.sha256(content).hexdigest()
    known = await _same_file(live, digest, options)
    if known is not None:
        return known
    if live.header.state in ENDED:
        raise ConflictError(f"the mission is {live.header.state} and takes no more soundings", "create a new mission")
    table, said = await _read(live, content, options, "soundings")
    loop = asyncio.get_running_loop()
    kept, merged = await loop.run_in_executor(executor, _kept, live, table)
    if not len(kept):
        raise InvalidRequestError("file", "none of its depths lies near the mission's area", "check file and crs")
    notes = [*said["notes"], *([f"{merged} soundings were merged per cell of the map"] if merged else [])]
    row = ImportRow(
        id=str(uuid.uuid4()),
        mission_id=live.id,
        digest=digest,
        filename=options.filename,
        created_at=now(),
        count=len(kept),
        summary=options.model_dump(mode="json")
        | {
            "notes": notes,
            "found": said["found"],
            "min_depth_m": float(kept[:, 2].min()),
            "max_depth_m": float(kept[:, 2].max()),
            "median_sd_m": float(np.median(kept[:, 3])),
        },
        soundings=sounding_queries.pack(kept),
    )
    view = _view(row)
    await to_the_end(_store_import(live, row))
    words = f"{view.taken} prior soundings of {view.filename} imported by {actor}"
    await live.journal.log(Level.INFO, "import", words, actor=actor)
    return view


async def delete_import(live: LiveMission, import_id: str, actor: str) -> None:
    """Take an import back. Raises ImportNotFoundError."""
    async with live.journal.writing, live.database.writing() as session:
        row = await session.get(ImportRow, import_id)
        if row is None or row.mission_id != live.id:
            raise ImportNotFoundError(
                f"there is no import {import_id!r}", "GET /api/v1/missions/{id}/imports lists them"
            )
        filename = row.filename
        await session.delete(row)
        await session.flush()
        await stored_maps.forget(session, live.id)
        prior = await sounding_queries.imported_arrays(session, live.id)
    live.builder.arrivals.replace_prior(prior)
    await live.journal.log(Level.INFO, "import", f"import of {filename} taken back by {actor}", actor=actor)


async def set_reference(live: LiveMission, content: bytes, options: ImportOptions, actor: str) -> ReferenceView:
    """Compare the mission's map with the grid in a file from now on. Raises InvalidRequestError."""
    depths, said = await _read(live, content, options, "reference")
    row = ReferenceRow(
        mission_id=live.id,
        filename=options.filename,
        created_at=now(),
        rows=depths.shape[0],
        cols=depths.shape[1],
        summary=options.model_dump(mode="json") | {"notes": said["notes"], "cells": int(np.isfinite(depths).sum())},
        depths=sounding_queries.pack(depths),
    )
    view = _reference_view(row)
    async with live.database.writing() as session:
        await _forget_reference(session, live.id)
        session.add(row)
    live.show_reference(depths)
    await live.journal.log(Level.INFO, "import", f"reference grid {options.filename} set by {actor}", actor=actor)
    return view


async def reference_of(live: LiveMission) -> ReferenceView:
    """Return what the map is compared with. Raises ImportNotFoundError when there is nothing."""
    async with live.database.reading() as session:
        row = await session.get(ReferenceRow, live.id)
    if row is None:
        raise ImportNotFoundError("the mission has no reference grid", "PUT /api/v1/missions/{id}/reference sets one")
    return _reference_view(row)


async def delete_reference(live: LiveMission, actor: str) -> None:
    """Compare with nothing any more. Raises ImportNotFoundError when there was nothing."""
    await reference_of(live)
    async with live.database.writing() as session:
        await _forget_reference(session, live.id)
    live.show_reference(None)
    await live.journal.log(Level.INFO, "import", f"reference grid taken away by {actor}", actor=actor)


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
    if any(row.summary.get(name) != value for name, value in asked.items()):
        raise ConflictError(
            f"the same file was imported before, as {row.filename}, with other options",
            f"take that import back first: DELETE /api/v1/missions/{live.id}/imports/{row.id}",
        )
    return _view(row).model_copy(update={"replayed": True})


async def _store_import(live: LiveMission, row: ImportRow) -> None:
    # A map that is stored meanwhile would lack these.
    async with live.journal.writing, live.database.writing() as session:
        session.add(row)
        await session.flush()
        await stored_maps.forget(session, live.id)
        prior = await sounding_queries.imported_arrays(session, live.id)
    live.builder.arrivals.replace_prior(prior)
    live.changed.set()
    live.publish_summary()


def _kept(live: LiveMission, table: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    """Return the soundings in or near the area, (n, 4), and how many were merged into them (0: none was)."""
    zone = Polygon(live.area).buffer(live.margin_m)
    shapely.prepare(zone)
    near = table[shapely.contains_xy(zone, table[:, 0], table[:, 1])]
    if len(near) <= MAX_PRIOR:
        return near, 0
    merged, group = merge_soundings(Soundings(*near.T.copy()), live.spec.cell_m)
    # Errors of one survey belong together: a mean of many is not better known than one of them.
    deviation = np.sqrt(np.bincount(group, near[:, 3] ** 2) / np.bincount(group))
    return np.column_stack([merged.east_m, merged.north_m, merged.depth_m, deviation]), len(near)


async def _read(
    live: LiveMission, content: bytes, options: ImportOptions, what: Literal["soundings", "reference"]
) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Read a file in a process of its own; returns what it wrote and what it said."""
    try:
        suffix = ending(options.filename)
    except ReadError as error:
        raise InvalidRequestError(error.field, str(error), error.remedy) from None
    if not content:
        raise InvalidRequestError("file", "it is empty", "send the file's content as the body")
    grid = live.builder.grid
    task = {
        "what": what,
        "origin": (live.frame.origin_lat_deg, live.frame.origin_lon_deg),
        "grid": {name: getattr(grid, name) for name in ("west_m", "south_m", "cell_m", "rows", "cols")},
        "margin_m": live.margin_m,
        "options": options.model_dump(mode="json", exclude={"filename", "source"}),
    }
    with tempfile.TemporaryDirectory(prefix="bathyfleet-") as folder:
        path, out = Path(folder) / f"file{suffix}", Path(folder) / "found.npy"
        await asyncio.to_thread(path.write_bytes, content)
        code, text = await _run_reader(path, json.dumps(task), out)
        if code == UNUSABLE:
            fault = json.loads(text)
            raise InvalidRequestError(fault["field"], fault["message"], fault["remedy"])
        if code != 0:
            said = "the reading process broke off: the file is damaged or too large"
            raise InvalidRequestError("file", said, "check or divide it")
        return await asyncio.to_thread(np.load, out, allow_pickle=False), json.loads(text)


async def _run_reader(path: Path, task: str, out: Path) -> tuple[int, str]:
    """Return the reader's exit code and what it said; a reader that takes too long is ended."""
    search = os.pathsep.join(filter(None, [ROOT, os.environ.get("PYTHONPATH", "")]))
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "app.mapping.readers",
        str(path),
        task,
        str(out),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": search},
        # Its own session: a signal from a terminal to the service is not for it.
        start_new_session=True,
    )
    try:
        stdout, _ = await asyncio.wait_for(process.communicate(), READING_TIMEOUT_S)
    except TimeoutError:
        return -signal.SIGKILL, ""
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    return process.returncode or 0, stdout.decode()


def _view(row: ImportRow) -> ImportView:
    return ImportView(
        id=row.id,
        filename=row.filename,
        source=row.summary["source"],
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
