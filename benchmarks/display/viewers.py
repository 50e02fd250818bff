"""What many live viewers cost the service: ``python -m benchmarks.display.viewers [--viewers 200] [--slow 20]``.

The real service with ten vehicles that report five times a second; so many WebSockets look at the mission, some of them
slowly: they take one message in two seconds. Measured are the service's processor time and memory with one viewer and
with all of them, how late positions reach those who keep up, and how often a slow one was let go. Printed is one JSON
object.
"""

import asyncio
import contextlib
import json
import time
from datetime import datetime
from typing import Any

import numpy as np
import psutil
import websockets

from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.boats import RATE_HZ, begin, beside, create_mission, running_service
from benchmarks.service.opening import Watch
from tests.support.dashboard.service import Service

SLOW_S = 2.0
VEHICLES = 10


async def view(address: str, pause_s: float, ages_s: list[float], counts: dict[str, int]) -> None:
    """Look on; one that is let go comes again."""
    while True:
        with contextlib.suppress(OSError, websockets.WebSocketException):
            async with websockets.connect(address, max_size=None, max_queue=1 if pause_s else 16) as line:
                async for message in line:
                    counts["messages"] += 1
                    if pause_s:
                        await asyncio.sleep(pause_s)
                    elif str(message).startswith('{"type":"vehicles"'):
                        sent = datetime.fromisoformat(json.loads(message)["time"])
                        ages_s.append(time.time() - sent.timestamp())
        counts["let_go"] += 1
        await asyncio.sleep(0.5)


async def look(service: Service, mission: str, viewers: int, slow: int, seconds: float) -> dict[str, Any]:
    """Let so many look on, and count what it takes."""
    address = service.url.replace("http", "ws") + f"/api/v1/missions/{mission}/live"
    ages: list[float] = []
    counts = {"messages": 0, "let_go": 0}
    process = psutil.Process(service.pid)
    tasks = [
        asyncio.create_task(view(address, SLOW_S if number < slow else 0.0, ages, counts)) for number in range(viewers)
    ]
    await asyncio.sleep(4.0)
    ages.clear()
    messages, cpu, began = counts["messages"], sum(process.cpu_times()[:2]), time.monotonic()
    with Watch(service) as watch:
        await asyncio.sleep(seconds)
    wall = time.monotonic() - began
    found = {
        "viewers": viewers,
        "slow": slow,
        "service_cores": round((sum(process.cpu_times()[:2]) - cpu) / wall, 3),
        "messages_per_s": round((counts["messages"] - messages) / wall),
        "positions_late_ms": f"{1000 * np.median(ages):.0f} median, {1000 * np.percentile(ages, 99):.0f} for 99 %",
        "let_go": counts["let_go"],
        "longest_hold_up_ms": round(1000 * watch.longest_s),
        "memory_mb": round(process.memory_info().rss / 1e6),
    }
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return found


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--viewers", type=int, default=200)
    parser.add_argument("--slow", type=int, default=20, help="of them take one message in two seconds")
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    with running_service(log_level="warning", time_scale="1", max_streams="1000") as service:
        mission = create_mission(service, VEHICLES, cell_m=2.0)
        begin(service, mission, VEHICLES)
        with beside("sail", service.url, mission, str(VEHICLES), "1.0"):
            time.sleep(5.0)
            one = asyncio.run(look(service, mission, 1, 0, options.seconds))
            many = asyncio.run(look(service, mission, options.viewers, options.slow, options.seconds))
    result = {"vehicles": VEHICLES, "reports_per_s": VEHICLES * RATE_HZ, "one": one, "many": many}
    more = (many["service_cores"] - one["service_cores"]) / max(options.viewers - 1, 1)
    result["cores_per_viewer"] = round(more, 5)
    print(json.dumps(result))
    write_section(options.write, LOAD, f"{options.viewers} live viewers", result)


if __name__ == "__main__":
    main()
