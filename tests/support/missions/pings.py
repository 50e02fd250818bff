"""Pings over the harbour of the missions in ``specs``, and a store for them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from app.mapping.swath.pings import Pings
from app.missions.fleet.interface import PingReport, Position
from app.missions.live.journals.journal import Counts
from app.missions.pings.gate import PingGate
from app.missions.pings.store import PingStore, TakenPings
from app.storage.database import Database
from app.storage.ping_files import PingFiles
from tests.support.missions.specs import FRAME, LAT, LON

CLOCK_S = 1_795_225_140.0
MARGIN_M = 100.0


def ping(number: int = 0, beams: int = 8, **changes: Any) -> PingReport:
    """The ping of that number: one every 0.2 s, each a little farther north."""
    angles = np.radians(np.linspace(-60, 60, beams)).astype(np.float32)
    values: dict[str, Any] = {
        "vehicle": "a",
        "time_s": CLOCK_S + 0.2 * number,
        "position": Position(LAT + 1e-7 * number, LON, 2.0),
        "roll_rad": 0.01,
        "pitch_rad": -0.02,
        "heading_rad": 1.5,
        "angles_rad": angles,
        "ranges_m": (10.0 / np.cos(angles) + 0.001 * number).astype(np.float32),
        "source": "sonar",
    }
    return replace(PingReport(**values), **changes)


def posted_ping(number: int = 0, beams: int = 8, **changes: Any) -> dict[str, Any]:
    """The same as a vehicle posts it."""
    report = ping(number, beams)
    values: dict[str, Any] = {
        "vehicle": "rover",
        "time_s": report.time_s,
        "lat_deg": report.position.lat_deg,
        "lon_deg": report.position.lon_deg,
        "depth_m": 2.0,
        "heading_deg": 86.0,
        "beams": {
            "angles_deg": np.degrees(report.angles_rad).astype(float).round(3).tolist(),
            "ranges_m": report.ranges_m.astype(float).round(3).tolist(),
        },
    }
    return values | changes


def outside(east: float, north: float) -> str:
    return "position: too far" if abs(east) > MARGIN_M or abs(north) > MARGIN_M else ""


def make_gate() -> PingGate:
    return PingGate(FRAME, outside)


async def open_store(database: Database, files: PingFiles, mission_id: str = "m1") -> tuple[PingStore, Counts]:
    """The store of a mission as a new process opens it, and what it finds."""
    store = PingStore(database, mission_id, make_gate(), files)
    async with database.reading() as session:
        found = await store.open(session)
    await store.tidy()
    return store, Counts(pings=found.pings, beams=found.beams, rejected_pings=found.rejected)


async def take(store: PingStore, database: Database, reports: Sequence[PingReport]) -> TakenPings:
    judged = await store.judge(reports)
    async with database.writing() as session:
        taken = await store.take([judged], 0, session)
    store.committed(taken)
    return taken


async def times_of(store: PingStore, until_block: int | None = None) -> dict[str, list[float]]:
    """The times of all accepted pings by vehicle, as they are read back."""
    found: dict[str, list[float]] = {}
    async for vehicle, pings in store.all_accepted(until_block):
        found.setdefault(vehicle, []).extend(pings.time_s.tolist())
    return found


def same(one: Pings, other: Pings) -> bool:
    """Whether pings are the same; beams that only fill up do not count."""
    both = Pings.joined([one, other])
    half = len(one)
    first, second = both.take(slice(None, half)), both.take(slice(half, None))
    return len(other) == half and all(
        np.array_equal(getattr(first, name), getattr(second, name), equal_nan=True) for name in vars(first)
    )
