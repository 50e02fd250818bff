"""Whole sessions of a panel that behaves as Neptus' real one, against the real gateway, at length and in real time.

``python -m benchmarks.imc.neptus_sessions --terrain FILE.npz --steps 49 --scale 5 --lost 10 --spoilt 20 --restart 30``
"""

import argparse
import asyncio
import json
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from app.missions.settings import ImcSettings, ServiceSettings
from app.missions.views.measurements.soundings import Verdict
from app.storage.upkeep.prepare import prepare_database
from benchmarks.common.report import IMC, make_parser, write_section
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import load_terrain
from tests.support.missions.stored_soundings import soundings_of
from tests.support.neptus.gateway import SESSION, Gateway
from tests.support.neptus.panel import DVL, FORWARD, Auv, RealPanel
from tests.support.ports import free_ports

ROWS = COLS = 100
CENTRE = 41.1855, -8.7045


def main() -> None:
    parser = make_parser(__doc__, IMC)
    parser.add_argument("--terrain", type=Path, required=True, help="sea floor of at least 100 m x 100 m")
    parser.add_argument("--steps", type=int, default=49)
    parser.add_argument("--scale", type=float, default=1.0, help="how much faster than the panel its vehicles live")
    parser.add_argument("--pace", type=float, default=1.0, help="how much faster than the clock the panel lives")
    parser.add_argument("--lost", type=int, nargs="*", default=[], help="steps whose upload is lost")
    parser.add_argument("--spoilt", type=int, nargs="*", default=[], help="steps whose upload is refused")
    parser.add_argument("--restart", type=int, default=0, help="step at which the service is restarted")
    options = parser.parse_args()
    result = asyncio.run(fly(options))
    print(json.dumps(result))
    title = f"A session of {options.steps} steps with Neptus' panel"
    write_section(options.write, IMC, title, result, hidden={options.terrain: "FILE.npz"})


async def fly(asked: argparse.Namespace) -> dict[str, Any]:
    """One session; returns its figures."""
    terrain = load_terrain(asked.terrain)
    with tempfile.TemporaryDirectory() as folder:
        gateway = _gateway(Path(folder))
        await prepare_database(gateway.settings.database_url, may_upgrade=True)
        await gateway.open()
        ftp_port, http_port = gateway.ports
        panel = RealPanel(
            ftp_port,
            http_port,
            lambda row, col: _depth_m(terrain, row, col),
            ROWS,
            COLS,
            [Auv(30.0, 30.0, 1.5, (*DVL, FORWARD)), Auv(70.0, 60.0, 3.0, (*DVL, FORWARD))],
            pace=asked.pace,
            scale=asked.scale,
            lost=frozenset(asked.lost),
            spoilt=frozenset(asked.spoilt),
        )
        try:
            await asyncio.to_thread(panel.connect)
            began = time.monotonic()
            thread = threading.Thread(target=panel.start, args=(asked.steps,))
            thread.start()
            restarted = not asked.restart
            while thread.is_alive():
                await asyncio.sleep(0.2)
                if not restarted and panel.time_step >= asked.restart:
                    restarted = True
                    await gateway.close()
                    await gateway.open()
            return await _figures(gateway, panel, terrain, time.monotonic() - began)
        finally:
            panel.stop()
            await gateway.close()
            panel.close()


async def _figures(gateway: Gateway, panel: RealPanel, terrain: Terrain, took_s: float) -> dict[str, Any]:
    mission = await gateway.mission()
    area = gateway.service_area()
    rows = await soundings_of(await gateway.service.get(mission.id))
    errors = np.array(
        [
            row.depth_m - _depth_m(terrain, *area.to_cells(row.lat_deg, row.lon_deg))
            for row in rows
            if row.verdict == Verdict.ACCEPTED
        ]
    )
    reasons: dict[str, int] = {}
    for row in rows:
        if row.verdict != Verdict.ACCEPTED:
            reason = row.reason.split(":")[0]
            reasons[reason] = reasons.get(reason, 0) + 1
    places = [place[:2] for answer in panel.answers for place in answer]
    border_m = [min(row, col, ROWS - row, COLS - col) for row, col in places]
    return {
        "session": SESSION,
        "answers": len(panel.answers),
        "steps": mission.progress.step,
        "state": str(mission.state),
        "took_s": round(took_s, 1),
        "accepted": len(errors),
        "rejected": reasons,
        "bias_m": round(float(errors.mean()), 4),
        "rms_m": round(float(np.sqrt((errors**2).mean())), 4),
        "over_5_m": int((np.abs(errors) > 5.0).sum()),
        "largest_m": round(float(np.abs(errors).max()), 2),
        "samples": sum(len(upload["MBSamples"]) for upload in panel.uploads),
        "refused": (await gateway.log("neptus"))[-1],
        "repeats": await gateway.log("neptus-repeat"),
        "waited_s": {"median": round(float(np.median(panel.waited_s)), 2), "longest": _longest(panel.waited_s)},
        "nearest_to_border_m": round(min(border_m), 2),
        "coverage_pct": round(mission.progress.coverage_pct, 1),
    }


def _longest(waited_s: list[float]) -> list[tuple[int, float]]:
    order = np.argsort(waited_s)[::-1][:4]
    return [(int(index) + 1, round(waited_s[index], 1)) for index in order]


def _depth_m(terrain: Terrain, row: float, col: float) -> float:
    return terrain.depth_at_point(min(max(col, 0.0), COLS - 0.01), min(max(row, 0.0), ROWS - 0.01))


def _gateway(folder: Path) -> Gateway:
    ports = free_ports(2)
    neptus = {
        "enabled": True,
        "ftp_port": ports[0],
        "http_port": ports[1],
        "centre_lat_deg": CENTRE[0],
        "centre_lon_deg": CENTRE[1],
        "rows": ROWS,
        "cols": COLS,
    }
    settings = ServiceSettings.model_validate(
        {
            "database_url": f"sqlite+aiosqlite:///{folder}/sessions.db",
            "imc": ImcSettings(enabled=False),
            "neptus": neptus,
        }
    )
    return Gateway(settings, ports)


if __name__ == "__main__":
    main()
