"""Queries on the scans of search missions."""

import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from sqlalchemy import ColumnElement, and_, delete, insert, select, tuple_
from sqlalchemy.ext.asyncio import AsyncSession

from app.storage.models import ScanRow

Identity = tuple[str, float]
"""What makes a scan the same scan within a mission: vehicle, vehicle's time."""

IDENTITY = (ScanRow.vehicle, ScanRow.time_s)
CHUNK = 300


async def known_scans(session: AsyncSession, mission_id: str, wanted: Sequence[Identity]) -> dict[Identity, str]:
    """Return the verdicts on those of the scans that are stored already."""
    found: dict[Identity, str] = {}
    for first in range(0, len(wanted), CHUNK):
        query = select(*IDENTITY, ScanRow.verdict).where(_are(mission_id, wanted[first : first + CHUNK]))
        found |= {(vehicle, time_s): verdict for vehicle, time_s, verdict in await session.execute(query)}
    return found


async def remove_scans(session: AsyncSession, mission_id: str, unwanted: Sequence[Identity]) -> None:
    """Take scans out that others come in place of."""
    for first in range(0, len(unwanted), CHUNK):
        await session.execute(delete(ScanRow).where(_are(mission_id, unwanted[first : first + CHUNK])))


def _are(mission_id: str, scans: Sequence[Identity]) -> ColumnElement[bool]:
    return and_(ScanRow.mission_id == mission_id, tuple_(*IDENTITY).in_(scans))


async def add_scans(session: AsyncSession, rows: Sequence[dict[str, Any]]) -> None:
    """Store scans in their order."""
    if rows:
        await session.execute(insert(ScanRow), list(rows))


async def accepted_scans(session: AsyncSession, mission_id: str, until_step: int | None = None) -> Sequence[ScanRow]:
    """Return the accepted scans in the order they were judged, those until the end of a step where one is given."""
    query = select(ScanRow).where(ScanRow.mission_id == mission_id, ScanRow.verdict == "accepted")
    if until_step is not None:
        query = query.where(ScanRow.step <= until_step)
    return (await session.scalars(query.order_by(ScanRow.id))).all()


def pack_ranges(ranges_m: Sequence[float], mates: Sequence[int] = ()) -> bytes:
    """Return ranges as they are stored; ``mates`` are the beams that ended on a vehicle of the team."""
    stored = np.array(ranges_m, dtype="<f4")
    stored[list(mates)] *= -1.0
    return zlib.compress(stored.tobytes(), level=1)


def unpack_ranges(stored: bytes) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """Return the stored ranges of an accepted scan, and the beams that ended on a vehicle of the team."""
    ranges = np.frombuffer(zlib.decompress(stored), dtype="<f4").astype(np.float64)
    mates = np.flatnonzero(np.signbit(ranges) & ~np.isnan(ranges))
    return tuple(np.abs(ranges).tolist()), tuple(mates.tolist())
