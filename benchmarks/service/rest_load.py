"""What REST requests cost the service: ``python -m benchmarks.service.rest_load [--rate 1000] [--seconds 20]``.

The real service runs in a process of its own on a new SQLite file, ten vehicles that speak REST in a running mission.
One lean client (raw sockets, requests made ahead, answers looked at for status and length only) sends a mix over kept
connections at times that do not depend on the answers: a request that had to wait for a free connection is counted from
when it was due. ``--rate 0`` asks for as much as the service can do. ``--before TREE`` compares with
the program of another work tree, each measured in turn in one run. Printed is one JSON object.
"""

import argparse
import json
import re
import selectors
import socket
import statistics
import sys
import time
from collections import Counter, deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from benchmarks.common.report import LOAD, make_parser, write_section
from benchmarks.service.boats import START_S, Boat, begin, create_mission, running_service
from tests.support.dashboard.service import Service

LENGTH = re.compile(rb"content-length: (\d+)", re.IGNORECASE)
MIX = {"mission": 40, "measurements": 25, "waypoint": 20, "missions": 5, "vehicles": 5, "ready": 5}
"""Parts of a hundred."""
VEHICLES = 10


@dataclass
class Connection:
    """One kept connection and the request that is under way on it."""

    address: tuple[str, int]
    sock: socket.socket = field(init=False)
    kind: str = ""
    due_s: float = 0.0
    answer: bytes = b""
    missing: int | None = None

    def __post_init__(self) -> None:
        self.sock = socket.create_connection(self.address)
        self.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def ask(self, kind: str, request: bytes, due_s: float) -> None:
        self.kind, self.due_s, self.answer, self.missing = kind, due_s, b"", None
        self.sock.sendall(request)

    def read(self) -> int | None:
        """Read what is there; the status once the answer is whole."""
        part = self.sock.recv(262144)
        if not part:
            raise ConnectionError("the service closed the connection")
        if self.missing is None:
            self.answer += part
            head, found, body = self.answer.partition(b"\r\n\r\n")
            if not found:
                return None
            length = LENGTH.search(head)
            self.missing = (int(length[1]) if length else 0) - len(body)
        else:
            self.missing -= len(part)
        return int(self.answer[9:12]) if self.missing <= 0 else None


class Requests:
    """Makes the mix's requests; measurements are new ones each time."""

    def __init__(self, service: Service, mission: str, token: str) -> None:
        head = f"Host: 127.0.0.1:{service.port}\r\n" + (f"Authorization: Bearer {token}\r\n" if token else "")
        self._head = head
        paths = {
            "mission": f"/missions/{mission}",
            "waypoint": f"/missions/{mission}/vehicles/boat-1/waypoint?timeout_s=0&after_step=0",
            "missions": "/missions",
            "vehicles": "/vehicles",
            "ready": "/health/ready",
        }
        self._fixed = {kind: f"GET /api/v1{path} HTTP/1.1\r\n{head}\r\n".encode() for kind, path in paths.items()}
        self._post = f"/api/v1/missions/{mission}/measurements"
        self._count = 0
        order = [kind for kind, part in MIX.items() for _ in range(part)]
        # Every kind evenly spread: 37 has no factor in common with 100.
        self._order = [order[37 * i % 100] for i in range(100)]

    def next(self) -> tuple[str, bytes]:
        self._count += 1
        kind = self._order[self._count % 100]
        return kind, self._fixed.get(kind) or self._measurement()

    def _measurement(self) -> bytes:
        n = self._count
        boat = Boat(f"boat-{n % VEHICLES}", 5.0 + n % 480, 5.0 + n // 480 % 480, time_s=START_S + 1e5 + 0.01 * n)
        body = json.dumps({"items": [boat.item(2.0, sounds=True)]})
        head = f"Content-Type: application/json\r\nIdempotency-Key: k{n}\r\nContent-Length: {len(body)}\r\n"
        return f"POST {self._post} HTTP/1.1\r\n{self._head}{head}\r\n{body}".encode()


def drive(service: Service, requests: Requests, rate: float, seconds: float, connections: int) -> dict[str, Any]:
    """Ask for ``seconds``; what came of it."""
    lines = [Connection(("127.0.0.1", service.port)) for _ in range(connections)]
    selector = selectors.DefaultSelector()
    for line in lines:
        selector.register(line.sock, selectors.EVENT_READ, line)
    free, times, statuses = deque(lines), [], Counter[int]()
    by_kind: dict[str, list[float]] = {}
    began = time.perf_counter()
    sent = answered = 0
    while True:
        now = time.perf_counter() - began
        due = sent / rate if rate else now
        while free and due <= now and now < seconds:
            free.popleft().ask(*requests.next(), due_s=began + due)
            sent += 1
            due = sent / rate if rate else now
        if now >= seconds and answered == sent:
            break
        wait = max(0.0, due - now) if free and now < seconds else 1.0
        for key, _ in selector.select(min(wait, 1.0)):
            status = key.data.read()
            if status is not None:
                took = time.perf_counter() - key.data.due_s
                times.append(took)
                by_kind.setdefault(key.data.kind, []).append(took)
                statuses[status] += 1
                answered += 1
                free.append(key.data)
    wall = time.perf_counter() - began
    for line in lines:
        line.sock.close()
    times.sort()
    errors = sum(count for status, count in statuses.items() if status not in (200, 204))
    return {
        "requests_per_s": round(answered / wall),
        "errors": errors,
        "p50_ms": round(1000 * times[len(times) // 2], 1),
        "p99_ms": round(1000 * times[int(0.99 * len(times))], 1),
        "worst_ms": round(1000 * times[-1], 1),
        "median_ms_by_kind": {kind: round(1000 * statistics.median(t), 1) for kind, t in sorted(by_kind.items())},
        "wall": wall,
        "answered": answered,
    }


def measure(service: Service, requests: Requests, options: argparse.Namespace, rate: float) -> dict[str, Any]:
    """Drive the service and count the processor's time on both sides."""
    process, here = psutil.Process(service.pid), psutil.Process()
    drive(service, requests, min(rate or 100.0, 100.0), 2.0, options.connections)  # so that everything was used once
    before, own = process.cpu_times(), here.cpu_times()
    found = drive(service, requests, rate, options.seconds, options.connections)
    after, own_after = process.cpu_times(), here.cpu_times()
    spent = after.user + after.system - before.user - before.system
    client = own_after.user + own_after.system - own.user - own.system
    wall, answered = found.pop("wall"), found.pop("answered")
    return (
        {"asked_per_s": rate or "as many as answered"}
        | found
        | {
            "service_cores": round(spent / wall, 2),
            "requests_per_core_second": round(answered / spent),
            "client_cores": round(client / wall, 2),
            "service_memory_mb": round(process.memory_info().rss / 1e6),
        }
    )


def compare(options: argparse.Namespace) -> dict[str, Any]:
    """Measure another tree's service and this one's in turn, several times: what else runs here changes meanwhile."""
    found: dict[str, list[dict[str, Any]]] = {"before": [], "now": []}
    other = f"import sys; sys.path.insert(0, {str(options.before.resolve())!r})"
    settings = {"log_level": options.log, "time_scale": "1", "max_requests_per_s": "0"}
    with running_service(before=other, **settings) as before, running_service(**settings) as present:
        asked = {name: (service, begun(service, options)) for name, service in (("before", before), ("now", present))}
        for service, requests in asked.values():
            measure(service, requests, options, options.rate)  # what a first start compiles counts for neither
        for _ in range(options.rounds):
            for name, (service, requests) in asked.items():
                found[name].append(measure(service, requests, options, options.rate))
    shown: dict[str, Any] = {
        name: {
            "requests_per_core_second": [one["requests_per_core_second"] for one in rounds],
            "requests_per_s": [one["requests_per_s"] for one in rounds],
            "p50_ms": [one["p50_ms"] for one in rounds],
            "errors": sum(one["errors"] for one in rounds),
        }
        for name, rounds in found.items()
    }
    medians = {name: statistics.median(shown[name]["requests_per_core_second"]) for name in shown}
    errors = sum(shown[name]["errors"] for name in found)
    return shown | {"times_as_many": round(medians["now"] / medians["before"], 2), "errors": errors}


def begun(service: Service, options: argparse.Namespace) -> Requests:
    """Begin a mission of vehicles that speak REST."""
    mission = create_mission(service, VEHICLES, cell_m=2.0)
    begin(service, mission, VEHICLES)
    token = "" if options.open else service.make_token("benchmark", "operator")
    return Requests(service, mission, token)


def main() -> None:
    """Run and print."""
    parser = make_parser(__doc__, LOAD)
    parser.add_argument("--rate", type=float, default=1000.0, help="requests per second; 0: as many as are answered")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--connections", type=int, default=16)
    parser.add_argument("--open", action="store_true", help="without access tokens")
    parser.add_argument("--log", default="info", help="the service's log level")
    parser.add_argument("--before", type=Path, metavar="TREE", help="compare with the program in another work tree")
    parser.add_argument("--rounds", type=int, default=3, help="of a comparison")
    options = parser.parse_args()
    if options.before:
        result = compare(options)
        print(json.dumps(result))
        write_section(options.write, LOAD, "REST requests, before and now", result, hidden={options.before: "BEFORE"})
        sys.exit(1 if result["errors"] else 0)
    with running_service(log_level=options.log, time_scale="1", max_requests_per_s="0") as service:
        result = measure(service, begun(service, options), options, options.rate)
    print(json.dumps(result))
    asked = f"{options.rate:g} REST requests/s" if options.rate else "As many REST requests as are answered"
    write_section(options.write, LOAD, f"{asked}, mixed", result)
    sys.exit(1 if result["errors"] else 0)


if __name__ == "__main__":
    main()
