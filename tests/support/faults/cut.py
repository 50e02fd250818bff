"""A network between two machines that can be cut: a network namespace for the vehicles, a cable, and its plug."""

import asyncio
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.support.faults.missions import FRAME, SIDE_M
from tests.support.faults.sea import IDS, NAMES
from tests.support.ports import free_ports

ASHORE, AFLOAT = "10.77.13.1", "10.77.13.2"


def can_be_made() -> bool:
    """Whether this machine lets us make one."""
    if os.geteuid() != 0 or shutil.which("ip") is None:
        return False
    name = f"bf-try-{os.getpid()}"
    made = subprocess.run(["ip", "netns", "add", name], capture_output=True, check=False).returncode == 0
    if made:
        subprocess.run(["ip", "netns", "delete", name], check=True)
    return made


@dataclass
class Cable:
    """Between this namespace and that of the vehicles.

    Attributes
    ----------
    plug
        Our end of it.
    """

    namespace: str
    plug: str

    def pull(self) -> None:
        """Cut the network in two."""
        _ip("link", "set", self.plug, "down")

    def put_back(self) -> None:
        """Join it."""
        _ip("link", "set", self.plug, "up")


@contextmanager
def cable() -> Iterator[Cable]:
    """A namespace that only a cable leads to."""
    number = os.getpid() % 100_000
    made = Cable(f"bf-{number}", f"bfa{number}")
    far = f"bfb{number}"
    _ip("netns", "add", made.namespace)
    try:
        _ip("link", "add", made.plug, "type", "veth", "peer", "name", far, "netns", made.namespace)
        _ip("addr", "add", f"{ASHORE}/24", "dev", made.plug)
        _ip("link", "set", made.plug, "up")
        for command in (f"addr add {AFLOAT}/24 dev {far}", f"link set {far} up", "link set lo up"):
            _ip("-n", made.namespace, *command.split())
        yield made
    finally:
        _ip("netns", "delete", made.namespace)  # takes the cable with it


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


class Afar:
    """The vehicles behind the cable, in a process of their own, and the ports on which one speaks with them."""

    def __init__(self, speed: float) -> None:
        *self.announce_ports, self.port, self.base_port = free_ports(24)[:7]
        self.speed = speed

    def settings(self) -> dict[str, str]:
        """What a service needs to speak to them."""
        return {
            "IMC__ENABLED": "true",
            "IMC__INTERFACES": json.dumps([ASHORE]),
            "IMC__ANNOUNCE_PORTS": json.dumps(self.announce_ports),
            "IMC__PORT": str(self.port),
            "TIME_SCALE": f"{self.speed:g}",
        }

    @asynccontextmanager
    async def afloat(self, folder: Path, made: Cable) -> AsyncIterator[None]:
        """Let them float."""
        origin = f"{FRAME.origin_lat_deg},{FRAME.origin_lon_deg}"
        command: list[Any] = ["ip", "netns", "exec", made.namespace, sys.executable, "-m", "simulator"]
        command += ["--family", "harbour", "--size", f"{SIDE_M + 20.0:g}", "--origin", origin, "--speed", self.speed]
        command += ["--names", ",".join(NAMES), "--ids", ",".join(map(str, IDS)), "--start", "20,5", "--start", "40,5"]
        command += ["--bind", AFLOAT, "--announce-address", ASHORE, "--announce-address", "127.0.0.1"]
        command += ["--announce-ports", f"{self.announce_ports[0]}-{self.announce_ports[-1]}"]
        command += ["--base-port", self.base_port]
        with (folder / "vehicles.log").open("wb") as log:
            process = await asyncio.create_subprocess_exec(*map(str, command), stdout=log, stderr=log)
        try:
            yield
        finally:
            process.send_signal(signal.SIGTERM)
            await process.wait()
