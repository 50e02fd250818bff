"""The attacks that ``attacks.py`` plays. Each returns what was gained, and figures of its own.

Everything is bounded in count and time and goes to this machine's loopback addresses; attackers come from 127.0.0.66.
"""

import asyncio
import contextlib
import csv
import ftplib
import http.client
import io
import json
import multiprocessing
import os
import random
import socket
import struct
import sys
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import imcpy

from tests.support.faults import leading_out
from tests.support.faults.missions import FRAME, mission_of
from tests.support.faults.service import Service

ATTACKER = "127.0.0.66"
NOBODY = 65_534
"""An ordinary user of the machine."""
MIB = 2**20

Found = dict[str, Any]


@dataclass
class Attacked:
    """The service under attack, and what those have who may use it."""

    service: Service
    announce_ports: list[int]
    imc_port: int
    vehicle_port: int
    ftp_port: int
    tokens: dict[str, str] = field(default_factory=dict)
    mission: str = ""

    async def prepare(self) -> None:
        """Make a token of each role, and a mission that a polling vehicle takes part in."""
        for role in ("viewer", "vehicle", "operator"):
            for owner in ("", "another "):
                made = await self.command("token", "create", f"{owner}{role}", "--role", role)
                self.tokens[f"{owner}{role}"] = made.split()[-1]
        spec = mission_of([{"name": "boat", "kind": "rest"}, {"name": "probe", "kind": "rest"}])
        async with self.client("operator") as api:
            answer = (await api.post("/missions", json=spec)).raise_for_status()
            self.mission = str(answer.json()["id"])
            await api.post(f"/missions/{self.mission}/measurements", json={"items": [item(0), item(1, "probe")]})
            (await api.post(f"/missions/{self.mission}/start")).raise_for_status()

    async def survey(self) -> None:
        """Send honest soundings, and wait for the map that they are in."""
        async with self.client("vehicle") as api:
            path = f"/missions/{self.mission}/measurements"
            (await api.post(path, json={"items": [item(10 + i) for i in range(10_000)]})).raise_for_status()
        async with self.client("operator", patience_s=60) as api:
            # Answered once a map is made of what is there.
            (await api.get(f"/missions/{self.mission}/map.csv")).raise_for_status()

    async def command(self, *arguments: str) -> str:
        own = {name: value for name, value in os.environ.items() if not name.startswith("BATHYFLEET_")}
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", "from app.cli import main; main()", *arguments),
            env=own | {"BATHYFLEET_DATABASE_URL": self.service.database_url},
            cwd=self.service.folder,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        said = (await process.communicate())[0].decode()
        if process.returncode != 0:
            raise RuntimeError(f"bathyfleet {' '.join(arguments)} failed: {said}")
        return said

    def client(self, who: str = "", *, address: str = "127.0.0.1", patience_s: float = 120.0) -> httpx.AsyncClient:
        """A client with the token of ``who``; without one a stranger."""
        headers = {"Authorization": f"Bearer {self.tokens[who]}"} if who else {}
        transport = httpx.AsyncHTTPTransport(local_address=address)
        return httpx.AsyncClient(
            base_url=self.service.url, headers=headers, timeout=patience_s, transport=transport, trust_env=False
        )

    async def connect(self, address: str = ATTACKER) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """A bare connection."""
        return await asyncio.open_connection("127.0.0.1", self.service.port, local_addr=(address, 0))


def item(number: int, vehicle: str = "boat", **more: Any) -> dict[str, Any]:
    """A measurement."""
    lat, lon = FRAME.to_geographic(5.0 + number % 50, 5.0 + number // 50 % 50)
    place = {"lat_deg": float(lat), "lon_deg": float(lon), "depth_m": 1.0, "range_m": 6.0}
    return {"vehicle": vehicle, "time_s": 1_795_000_000.0 + number} | place | more


async def _status(answer: Awaitable[httpx.Response]) -> str:
    try:
        return str((await answer).status_code)
    except httpx.HTTPError as error:
        return type(error).__name__


def _wrong(statuses: Counter[str], allowed: Iterable[str]) -> list[str]:
    """What was answered that should not have been. A connection that was closed on the attacker is fine."""
    fine = {*allowed, "WriteError", "ReadError", "RemoteProtocolError", "ReadTimeout", "WriteTimeout"}
    return [f"answered {status}" for status in statuses if status not in fine]


async def nothing(attacked: Attacked) -> Found:
    """Use the service as it is meant."""
    async with attacked.client("vehicle") as api:
        sent = await api.post(f"/missions/{attacked.mission}/measurements", json={"items": [item(2)]})
    async with attacked.client("operator") as api:
        looked = await api.get(f"/missions/{attacked.mission}")
    return {"gained": [] if sent.is_success and looked.is_success else [sent.text, looked.text]}


async def stranger_json(attacked: Attacked) -> Found:
    """A stranger sends 7.8 MB of JSON whose texts have to be looked at."""
    body = json.dumps({"name": "\u0041", "items": [[{"a": i}] for i in range(460_000)]}).encode()
    body = body.replace(b'"A"', b'"\\u0041"')
    statuses: Counter[str] = Counter()
    async with attacked.client(address=ATTACKER) as api:
        head = {"Content-Type": "application/json"}
        for path in ("/missions", f"/missions/{attacked.mission}/measurements"):
            answers = [_status(api.post(path, content=body, headers=head)) for _ in range(4)]
            statuses += Counter(await asyncio.gather(*answers))
    return {"gained": _wrong(statuses, ["401", "413"]), "sent_mb": round(len(body) / 1e6, 1), "answers": statuses}


async def uploads(attacked: Attacked) -> Found:
    """Files of 60 MiB to a mission that there is not, by a stranger and by others who may not, twelve each."""
    content = os.urandom(MIB) * 60
    statuses: Counter[str] = Counter()
    for who in ("", "viewer", "vehicle", "operator"):
        async with attacked.client(who, address=ATTACKER) as api:
            path = "/missions/00000000-0000-4000-8000-000000000000/imports?filename=a.xyz"
            statuses += Counter(await asyncio.gather(*(_status(api.post(path, content=content)) for _ in range(12))))
    return {"gained": _wrong(statuses, ["401", "403", "404", "429", "503"]), "answers": statuses}


async def promised(attacked: Attacked) -> Found:
    """A stranger promises 8 MB and sends nothing: the answer does not wait for them."""
    waited_s = []
    for _ in range(5):
        reader, writer = await attacked.connect()
        writer.write(b"POST /api/v1/missions HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n")
        writer.write(b"Content-Length: 8000000\r\n\r\n")
        began = time.perf_counter()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(15):
                await reader.readline()
        waited_s.append(time.perf_counter() - began)
        writer.close()
    gained = [f"was waited for {max(waited_s):.1f} s"] if max(waited_s) > 3 else []
    return {"gained": gained, "answered_after_s": round(max(waited_s), 3)}


async def unknown_keys(attacked: Attacked) -> Found:
    """A vehicle's token: a batch of measurements with 200 000 unknown keys, in one item and in ten thousand."""
    path, statuses = f"/missions/{attacked.mission}/measurements", Counter[str]()
    one = {"items": [item(3) | {f"k{i}": i for i in range(200_000)}]}
    many = {"items": [item(i) | {f"k{j}": j for j in range(20)} for i in range(10_000)]}
    deep = b'{"items": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"
    long = json.dumps({"items": [item(4, "x" * 4_000_000)]}).encode()
    head = {"Content-Type": "application/json"}
    async with attacked.client("vehicle", address=ATTACKER) as api:
        for body in (json.dumps(one).encode(), json.dumps(many).encode(), deep, long):
            statuses += Counter(
                await asyncio.gather(*(_status(api.post(path, content=body, headers=head)) for _ in range(2)))
            )
    return {"gained": _wrong(statuses, ["200", "400", "413", "422", "429", "503"]), "answers": statuses}


async def large_batches(attacked: Attacked) -> Found:
    """A vehicle's token: honest batches as large as they may be, one after the other."""
    path, statuses = f"/missions/{attacked.mission}/measurements", Counter[str]()
    async with attacked.client("vehicle", address=ATTACKER) as api:
        for turn in range(3):
            items = [item(100 + 10_000 * turn + i) for i in range(10_000)]
            statuses[await _status(api.post(path, json={"items": items}))] += 1
    return {"gained": _wrong(statuses, ["200", "429", "503"]), "answers": statuses}


async def descriptions(attacked: Attacked) -> Found:
    """An operator's token: mission descriptions with 200 000 unknown keys, and with 100 000 corners."""
    spec = mission_of([{"name": "boat", "kind": "rest"}])
    jagged = [[-8.705 + 1e-8 * i, 41.185 + 1e-5 * (i % 2)] for i in range(100_000)]
    bodies = [
        spec | {f"k{i}": i for i in range(200_000)},
        spec | {"area": {"type": "Polygon", "coordinates": [[*jagged, [-8.7, 41.19], jagged[0]]]}},
        spec | {"vehicles": [{"name": f"v{i}", "kind": "rest"} for i in range(50_000)]},
    ]
    statuses: Counter[str] = Counter()
    async with attacked.client("operator", address=ATTACKER) as api:
        for body in bodies:
            statuses[await _status(api.post("/missions", json=body))] += 1
    return {"gained": _wrong(statuses, ["400", "413", "422", "429", "503"]), "answers": statuses}


async def external_storage(attacked: Attacked) -> Found:
    """An operator's token: files whose depths, links or transformations lie in other files of the server."""
    found: Found = {"gained": []}
    options: dict[str, Any] = {"crs": "EPSG:4326", "sd_m": 0.3, "positive": "down"}
    statuses: Counter[str] = Counter()
    async with attacked.client("operator") as api:
        for name, content in leading_out.grids(attacked.service.folder).items():
            made = await api.post("/missions", json=mission_of([{"name": "boat", "kind": "rest"}]))
            path = f"/missions/{made.json()['id']}"
            answer = await api.post(f"{path}/imports", params=options | {"filename": name}, content=content)
            soundings = (await api.get(f"{path}/imports")).text
            statuses[str(answer.status_code)] += 1
            if answer.is_success or leading_out.told(answer.text) or soundings != "[]":
                found["gained"].append(f"{name}: {answer.text[:200]}")
    return found | {"answers": statuses}


async def line_ends(attacked: Attacked) -> Found:
    """An operator's token: files of nothing but line ends, and of nothing but commas."""
    statuses: Counter[str] = Counter()
    began = time.perf_counter()
    async with attacked.client("operator", patience_s=300) as api:
        for content in (b"\n" * (60 * MIB), b"," * (30 * MIB), b"1,2,3\n" * (5 * MIB)):
            path = f"/missions/{attacked.mission}/imports?filename=a.csv"
            statuses[await _status(api.post(path, content=content))] += 1
    return {
        "gained": _wrong(statuses, ["400", "409", "413", "422"]),
        "answers": statuses,
        "took_s": round(time.perf_counter() - began, 1),
    }


def _packet(message: Any, number: int, seconds: float = 0.0) -> bytes:
    message.src, message.timestamp = number, time.time() + seconds
    return bytes(message.serialize())


def _announce(number: int, port: int, name: str) -> Any:
    message = imcpy.Announce()
    message.sys_name, message.sys_type = name, imcpy.SystemType.UUV
    message.services = f"dune://0.0.0.0/uid/{number}000;imc+info://0.0.0.0/version/5.4.31;imc+udp://127.0.0.1:{port}/"
    return message


async def heartbeats(attacked: Attacked) -> Found:
    """Heartbeats and announces under thousands of ids; then a real vehicle comes, and has to be seen."""
    loop = asyncio.get_running_loop()
    forger, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, local_addr=(ATTACKER, 0))
    vehicle, _ = await loop.create_datagram_endpoint(
        asyncio.DatagramProtocol, local_addr=("127.0.0.1", attacked.vehicle_port)
    )
    ours = ("127.0.0.1", attacked.imc_port)
    rng, sent = random.Random(0), 0  # noqa: S311 - nothing is kept secret by it
    seen_after_s, causes = None, set()
    began = time.monotonic()
    async with attacked.client("viewer") as api:
        while time.monotonic() - began < 20:
            for _ in range(100):
                forged = rng.randrange(0x0200, 0xFF00)
                forger.sendto(_packet(imcpy.Heartbeat(), forged), ours)
                if sent % 10 == 0:
                    announce = _announce(forged, 6000 + forged % 1000, f"forged-{forged}")
                    for port in attacked.announce_ports:
                        forger.sendto(_packet(announce, forged), ("127.0.0.1", port))
                sent += 1
            if time.monotonic() - began > 8:
                real = _announce(0x1E, attacked.vehicle_port, "lauv-xplore-1")
                for port in attacked.announce_ports:
                    vehicle.sendto(_packet(real, 0x1E), ("127.0.0.1", port))
                vehicle.sendto(_packet(imcpy.Heartbeat(), 0x1E), ours)
                state = imcpy.EstimatedState()
                state.lat, state.lon = 0.7188, -0.1519
                vehicle.sendto(_packet(state, 0x1E), ours)
                listed = (await api.get("/vehicles")).json()
                names = json.dumps(listed)
                if seen_after_s is None and "lauv-xplore-1" in names:
                    seen_after_s = time.monotonic() - began - 8
                doctor = (await api.get("/doctor")).json()
                causes |= {finding["cause"] for finding in doctor["own"]}
            await asyncio.sleep(0.05)
    forger.close()
    vehicle.close()
    gained = [] if seen_after_s is not None else ["the real vehicle is not seen"]
    gained += [] if "crowded" in causes else ["the doctor does not tell of it"]
    return {"gained": gained, "forged": sent, "seen_after_s": seen_after_s, "causes": sorted(causes)}


async def wrong_tokens(attacked: Attacked) -> Found:
    """A hundred wrong tokens, then an abort with a right one that is new to the service, from the same address."""
    statuses: Counter[str] = Counter()
    async with attacked.client() as api:
        for i in range(100):
            head = {"Authorization": f"Bearer bf_{i:064d}"}
            statuses[await _status(api.get("/missions", headers=head))] += 1
    async with attacked.client("another operator") as api:
        aborted = await api.post(f"/missions/{attacked.mission}/abort")
    gained = _wrong(statuses, ["401", "429"]) + ([] if aborted.is_success else [f"abort refused: {aborted.text}"])
    return {"gained": gained, "answers": statuses, "abort": str(aborted.status_code)}


async def connections(attacked: Attacked) -> Found:
    """Strangers hold 1200 connections: silent ones, and ones whose head never ends; then an operator aborts."""
    held = []
    for i in range(1200):
        try:
            async with asyncio.timeout(5):
                _, writer = await attacked.connect(f"127.0.0.{66 + i % 4}")
        except (OSError, TimeoutError):
            break
        held.append(writer)
        if i % 2:
            writer.write(b"GET /api/v1/missions HTTP/1.1\r\nHost: 127.0.0.1\r\nX-A: ")
    async with attacked.client("operator", patience_s=20) as api:
        status = await _status(api.post(f"/missions/{attacked.mission}/abort"))
    for writer in held:
        writer.close()
    gained = [] if status == "200" else [f"abort: {status}"]
    return {"gained": gained, "connections_held": len(held), "abort": status}


async def views(attacked: Attacked) -> Found:
    """A viewer's token opens as many event streams as it can; then an operator opens one."""
    tasks, began = [], asyncio.Event()
    answers: Counter[str] = Counter()

    async def hold(api: httpx.AsyncClient) -> None:
        head = {"Accept": "text/event-stream"}
        with contextlib.suppress(httpx.HTTPError):
            async with api.stream("GET", f"/missions/{attacked.mission}/events", headers=head) as answer:
                answers[str(answer.status_code)] += 1
                await began.wait()

    limits = httpx.Limits(max_connections=None)
    transport = httpx.AsyncHTTPTransport(local_address=ATTACKER, limits=limits)
    head = {"Authorization": f"Bearer {attacked.tokens['viewer']}"}
    async with httpx.AsyncClient(base_url=attacked.service.url, headers=head, transport=transport, timeout=30) as api:
        tasks = [asyncio.create_task(hold(api)) for _ in range(260)]
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(20):
                while answers.total() < len(tasks):  # noqa: ASYNC110
                    await asyncio.sleep(0.1)
        statuses = {}
        for who in ("another viewer", "operator"):
            async with (
                attacked.client(who) as other,
                other.stream(
                    "GET", f"/missions/{attacked.mission}/events", headers={"Accept": "text/event-stream"}
                ) as view,
            ):
                statuses[who] = str(view.status_code)
        began.set()
        await asyncio.gather(*tasks)
    gained = [f"{who}: {status}" for who, status in statuses.items() if status != "200"]
    return {"gained": gained, "answers": answers}


async def keys(attacked: Attacked) -> Found:
    """Another vehicle's token uses a key that is taken: it learns nothing, and nobody is refused for it."""
    path, key = f"/missions/{attacked.mission}/measurements", {"Idempotency-Key": "k-1"}
    async with attacked.client("another vehicle") as api:
        await api.post(path, json={"items": [item(900, "probe")]}, headers=key)
    async with attacked.client("vehicle") as api:
        answer = await api.post(path, json={"items": [item(901)]}, headers=key)
    gained = [] if answer.is_success and not answer.json().get("replayed") else [answer.text[:200]]
    return {"gained": gained}


async def control_characters(attacked: Attacked) -> Found:
    """Names, notes and paths with escape sequences, formulas and markup: nothing of it comes out as such."""
    evil = "\x1b[2J\x9b31m=cmd|' /C calc'!A0\u202e[red]\u2028"
    await attacked.command("token", "create", evil, "--role", "viewer")
    async with attacked.client("operator") as api:
        await api.post(f"/missions/{attacked.mission}/notes", json={"text": evil})
        await api.get("/missions/" + quote(evil))
        await api.post("/missions/" + quote(evil) + "/start")
        await api.post("/" + quote("=HYPERLINK(1)"))
        table = (await api.get(f"/missions/{attacked.mission}/map.csv")).text
    sheet = await attacked.command("audit", "--format", "csv")
    places = {
        "the audit log": await attacked.command("audit"),
        "the audit log as CSV": sheet,
        "the list of tokens": await attacked.command("token", "list"),
        "the log": attacked.service.said,
        "the table": table,
    }
    gained = [
        f"in {where}: {character!r}"
        for where, text in places.items()
        for character in ("\x1b", "\x9b", "\u202e", "\u2028")
        if character in text
    ]
    cells = [cell for text in (table, sheet) for row in csv.reader(io.StringIO(text)) for cell in row]
    formulas = [cell for cell in cells if cell.startswith(("=", "@"))]
    return {"gained": gained + formulas[:3]}


def _intrude(said: Any, port: int, folder: Path, ftp_port: int, mission: str) -> None:
    """Become another user, try everything, and say what was gained."""
    "".encode("idna")  # what sockets load when first used lies where another user may not read
    os.setgroups([])
    os.setgid(NOBODY)
    os.setuid(NOBODY)
    gained = []
    for path in folder.rglob("*"):
        with contextlib.suppress(OSError):
            if path.is_file() and path.name != "service.log":
                path.open("rb").close()
                gained.append(f"reads {path.name}")
    act = f"/api/v1/missions/{mission}/pause"
    for method, target in (("GET", "/api/v1/missions"), ("POST", act)):
        line = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
        line.request(method, target, "{}" if method == "POST" else None, {"Content-Type": "application/json"})
        if line.getresponse().status < 400:
            gained.append(f"{method} {target}")
    for _ in range(10):  # reset as soon as it is sent, so that nobody can be asked whose connection it was
        with socket.create_connection(("127.0.0.1", port)) as hasty:
            head = f"POST {act} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 2\r\nContent-Type: application/json"
            hasty.sendall(f"{head}\r\n\r\n{{}}".encode())
            hasty.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    with contextlib.suppress(ftplib.Error, EOFError, OSError), ftplib.FTP() as ftp:  # noqa: S321
        ftp.connect("127.0.0.1", ftp_port, timeout=20)
        ftp.login("NEPTUS", "anything")
        gained.append("logs in by FTP")
    said.send(gained)


async def another_user(attacked: Attacked) -> Found:
    """Another user of this machine, while there are no tokens: reads files, commands, resets, logs in by FTP."""
    if os.geteuid() != 0:
        return {"gained": [], "skipped": "only root can become another user"}
    for who in attacked.tokens:
        await attacked.command("token", "revoke", await _token_id(attacked, who))
    # Forked: another user may not be allowed to start this program's interpreter.
    mine, his = multiprocessing.Pipe(duplex=False)
    service = attacked.service
    arguments = (his, service.port, service.folder, attacked.ftp_port, attacked.mission)
    intruder = multiprocessing.get_context("fork").Process(target=_intrude, args=arguments)
    intruder.start()
    await asyncio.to_thread(intruder.join, 120)
    gained = mine.recv() if mine.poll() else ["the intruder broke off"]
    await asyncio.sleep(2)
    [(state,)] = service.rows("select state from missions where id = ?", attacked.mission)
    if state != "running":
        gained.append(f"the mission is {state}")
    return {"gained": gained}


async def _token_id(attacked: Attacked, name: str) -> str:
    return str(attacked.service.rows("select id from tokens where name = ?", name)[0][0])


ATTACKS: dict[str, tuple[str, Callable[[Attacked], Awaitable[Found]]]] = {
    "nothing": ("Nothing: the service in its own time", nothing),
    "stranger-json": ("A stranger sends large JSON", stranger_json),
    "promised": ("A stranger promises a body that does not come", promised),
    "uploads": ("Files for a mission that there is not", uploads),
    "unknown-keys": ("A vehicle sends unknown keys, deep nesting, long texts", unknown_keys),
    "large-batches": ("A vehicle sends the largest batches", large_batches),
    "descriptions": ("An operator sends large descriptions", descriptions),
    "external-storage": ("An operator's file names a file of the server", external_storage),
    "line-ends": ("An operator sends line ends and commas", line_ends),
    "heartbeats": ("Forged heartbeats and announces, then a real vehicle", heartbeats),
    "wrong-tokens": ("Wrong tokens, then an abort", wrong_tokens),
    "connections": ("Connections that are held, then an abort", connections),
    "views": ("Live views that are held", views),
    "keys": ("Another's idempotency key", keys),
    "control-characters": ("Escape sequences and formulas in texts", control_characters),
    "another-user": ("Another user of this machine", another_user),
}
