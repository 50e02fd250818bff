"""What attackers try, against the real service: ``python -m benchmarks.service.attacks [ATTACK …] [--write]``.

Strangers without a token, holders of a vehicle's token, operators whose files are not what they say, another user of
this machine, and senders on the vehicles' network. Each attack is bounded and stays on this machine's loopback. The
service runs in a process of its own with access tokens. Meanwhile another process asks ``/health/live`` twenty times
a second, each time on a new connection. An attack holds when nothing was gained by it, 99 of 100 of those questions
were answered within 250 ms, and the service's memory is back to within 10 % half a minute later.
Exit code 1 when one did not hold.
"""

import argparse
import asyncio
import contextlib
import json
import os
import socket
import statistics
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import psutil

from benchmarks.common.report import Page, make_parser, write_section
from benchmarks.service.attackers import ATTACKS, Attacked
from tests.support.faults.service import Service
from tests.support.ports import free_ports

PAGE = Page(
    "attacks.md",
    """# Attacks: what was tried

Every section is written by the command that stands in it. The service runs as a process of its own with access tokens;
attackers are other processes and connections of the same machine, which take part of its two cores themselves.
`live_p99_ms` is how long `/health/live` took meanwhile, on new connections, in 99 of 100 cases; it is asked to be
at most 250. `memory_after` is the service's resident memory once the attack is over, over what it was before; it is
asked to be at most 1.10. `gained` lists what the attacker got; nothing is asked for.
`load_of_the_machine` is the mean number of programs that wanted one of its cores.
""",
    timed=True,
)
MOST_LIVE_MS = 250.0
MOST_MEMORY = 1.10
SETTLING_S = 30.0
PERIOD_S = 0.05


def probe(port: int) -> None:
    """Ask whether the service lives until standard input ends; print how long each answer took, in ms."""
    request = b"GET /api/v1/health/live HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n"
    os.set_blocking(0, False)
    while sys.stdin.buffer.read(1) is None:
        began = time.perf_counter()
        answered = b""
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=30) as line:
            line.sendall(request)
            answered = line.recv(4096)
        took_s = time.perf_counter() - began
        # Refused or unanswered counts like an answer that came too late.
        print(1000 * took_s if b" 200 " in answered[:20] else 30_000.0, flush=True)
        time.sleep(max(0.0, PERIOD_S - took_s))


@contextlib.asynccontextmanager
async def watched(service: Service, figures: dict[str, Any]) -> AsyncIterator[None]:
    """Ask the service all the time whether it lives, and look at its memory."""
    process = psutil.Process(service.pid)
    before = peak = process.memory_info().rss
    watcher = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "benchmarks.service.attacks", "--probe", str(service.port), stdin=-1, stdout=-1
    )

    async def look() -> None:
        nonlocal peak
        while True:
            peak = max(peak, process.memory_info().rss)
            await asyncio.sleep(0.05)

    looking = asyncio.create_task(look())
    try:
        if watcher.stdout is not None:
            await watcher.stdout.readline()  # on a busy machine it takes a while to begin
        await asyncio.sleep(1.0)
        yield
        await asyncio.sleep(1.0)
    finally:
        looking.cancel()
        said = (await watcher.communicate(b""))[0].decode().split()
    times = sorted(map(float, said))
    deadline = time.monotonic() + SETTLING_S
    while process.memory_info().rss > MOST_MEMORY * before and time.monotonic() < deadline:  # noqa: ASYNC110
        await asyncio.sleep(0.5)
    figures |= {
        "live_p50_ms": round(statistics.median(times), 1),
        "live_p99_ms": round(times[int(0.99 * (len(times) - 1))], 1),
        "live_worst_ms": round(times[-1], 1),
        "asked": len(times),
        "memory_before_mb": round(before / 1e6),
        "memory_peak": round(peak / before, 2),
        "memory_after": round(process.memory_info().rss / before, 2),
    }


@contextlib.asynccontextmanager
async def attacked_service(folder: Path) -> AsyncIterator[Attacked]:
    """A service with a running mission, and tokens for everybody who may have one."""
    *announce, imc_port, vehicle_port, ftp_port, http_port = free_ports(24)[:7]
    settings = {
        "IMC__ENABLED": "true",
        "IMC__LOOPBACK_ONLY": "true",
        "IMC__ANNOUNCE_PORTS": json.dumps(announce),
        "IMC__PORT": str(imc_port),
        "NEPTUS__ENABLED": "true",
        "NEPTUS__FTP_PORT": str(ftp_port),
        "NEPTUS__HTTP_PORT": str(http_port),
        "NEPTUS__CENTRE_LAT_DEG": "41.185",
        "NEPTUS__CENTRE_LON_DEG": "-8.705",
        "SLOW_CLIENT_S": "10",
    }
    service = Service(folder, settings=settings)
    attacked = Attacked(service, announce, imc_port, vehicle_port, ftp_port)
    await service.start()
    try:
        async with httpx.AsyncClient(base_url=service.url, timeout=60) as api:
            await service.await_ready(api)
        await attacked.prepare()
        yield attacked
    finally:
        if service.process is not None and service.process.returncode is None:
            await service.kill()


async def play(name: str) -> dict[str, Any]:
    """Play one attack against a service of its own; what came of it."""
    with tempfile.TemporaryDirectory(prefix="bathyfleet-attacks-") as folder:
        os.chmod(folder, 0o755)  # noqa: PTH101, S103 - open to others: it is the service's own files that have to be closed
        async with attacked_service(Path(folder)) as attacked:
            # So that everything was used once, and a map of many soundings was made.
            await ATTACKS["nothing"][1](attacked)
            await attacked.survey()
            figures: dict[str, Any] = {}
            async with watched(attacked.service, figures):
                found = await ATTACKS[name][1](attacked)
    gained = found.pop("gained")
    held = not gained and figures["live_p99_ms"] <= MOST_LIVE_MS and figures["memory_after"] <= MOST_MEMORY
    return {"held": held, "gained": gained} | found | figures


def main() -> None:
    """Play and print; exit code 1 when an attack did not hold."""
    parser = make_parser(__doc__, PAGE)
    parser.add_argument("attack", nargs="*", choices=[*ATTACKS, []], help="which ones; without any: all")
    parser.add_argument("--probe", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.probe is not None:
        probe(options.probe)
        return
    broken = 0
    for name in options.attack or ATTACKS:
        figures = asyncio.run(play(name))
        broken += not figures["held"]
        print(json.dumps({"attack": name} | figures), flush=True)
        write_section(options.write, PAGE, ATTACKS[name][0], figures)
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
