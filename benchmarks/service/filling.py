"""Fills a mission with soundings quickly, straight into the tables: for benchmarks of what is stored already.

A multibeam's soundings over the whole area, of ten vehicles, as the gate would have stored them. SQLite makes the rows
itself: five million take about a minute.
"""

import math
import sqlite3
from pathlib import Path

BEAMS = 100
VEHICLES = 10
START_S = 1_795_000_000.0
FLOOR = "10 + 8 * n / {side} + 6 * abs((e + n) % 200 - 100) / 100 + 0.3 * sin(e / 7) * cos(n / 5)"


def fill(file: Path, mission_id: str, soundings: int, side_m: float, origin: tuple[float, float]) -> None:
    """Store so many accepted soundings, evenly over a square of ``side_m`` from ``origin`` (latitude, longitude)."""
    lat, lon = origin
    per_deg = 111_200.0
    east_deg = 1.0 / (per_deg * math.cos(math.radians(lat)))
    pings = soundings // BEAMS
    # One ping after the other along lines; a low-discrepancy shift keeps the places from lying on a lattice.
    query = f"""
        WITH RECURSIVE
            ping(p) AS (SELECT 0 UNION ALL SELECT p + 1 FROM ping WHERE p + 1 < {pings}),
            beam(b) AS (SELECT 0 UNION ALL SELECT b + 1 FROM beam WHERE b + 1 < {BEAMS}),
            place AS MATERIALIZED (
                SELECT p, b,
                    {side_m} * ((p * 0.7548776662466927 + b * 0.01) - floor(p * 0.7548776662466927 + b * 0.01)) AS e,
                    {side_m} * ((p * 0.5698402909980532 + b * 0.013) - floor(p * 0.5698402909980532 + b * 0.013)) AS n
                FROM ping CROSS JOIN beam
            )
        INSERT INTO soundings (
            mission_id, vehicle, time_s, beam, received_at, step, source, lat_deg, lon_deg, east_m, north_m,
            vehicle_depth_m, range_m, raw_depth_m, depth_m, sd_m, position_sd_m, level_m, verdict, reason
        )
        SELECT ?, 'multi-' || (p % {VEHICLES}), {START_S} + p / {VEHICLES} * 0.1, b, '2026-11-20 12:00:00.000000',
            p / {max(1, pings // 1000)}, 'multibeam', {lat} + n / {per_deg}, {lon} + e * {east_deg}, e, n,
            3.0, {FLOOR.format(side=side_m)} - 3.0, {FLOOR.format(side=side_m)}, {FLOOR.format(side=side_m)},
            0.1, 1.0, 0.0, 'accepted', ''
        FROM place
    """  # noqa: S608 - numbers of this file only
    with sqlite3.connect(file) as connection:
        connection.execute("PRAGMA foreign_keys=ON")
        connection.execute("PRAGMA synchronous=OFF")
        connection.execute("PRAGMA cache_size=-400000")
        connection.execute(query, (mission_id,))
    connection.close()
