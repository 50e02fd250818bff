"""The real service in a process of its own, which a test can kill and start again."""

import contextlib
import socket
import subprocess
import time
from pathlib import Path
from typing import Any

import httpx

from tests.support.commands import COMMAND, environment
from tests.support.missions.specs import AREA

START_LIMIT_S = 180
GLANCE_S = 0.05


class Service:
    """``bathyfleet serve`` with simulated vehicles, on one port and one database for all its lives.

    ``before`` is Python that its processes run first.
    """

    def __init__(self, folder: Path, before: str = "", **settings: str) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port: int = probe.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"
        self._folder = folder
        self._command = [*COMMAND[:-1], f"{before}\n{COMMAND[-1]}"]
        self._settings = {f"BATHYFLEET_{name.upper()}": value for name, value in settings.items()}
        self._log = folder / "service.log"
        self._process: subprocess.Popen[bytes] | None = None
        # Loading certificates that plain HTTP does not need takes longer than a request. No connection outlives one.
        none_kept = httpx.Limits(max_keepalive_connections=0)
        self._http = httpx.Client(base_url=self.url, timeout=60, verify=False, limits=none_kept)  # noqa: S501

    @property
    def _environment(self) -> dict[str, str]:
        database_url = f"sqlite+aiosqlite:///{self.database}"
        own = {"BATHYFLEET_DATABASE_URL": database_url, "BATHYFLEET_TIME_SCALE": "5"} | self._settings
        return environment(**own)

    @property
    def database(self) -> Path:
        """Its SQLite file."""
        return self._folder / "service.db"

    def command(self, *arguments: str) -> str:
        """Run another of the program's commands and return what it says."""
        command = [*self._command, *arguments]
        return subprocess.run(
            command, cwd=self._folder, env=self._environment, capture_output=True, text=True, check=True
        ).stdout

    def make_token(self, name: str, role: str) -> str:
        """Make an access token on the command line; from then on the service asks for one."""
        return self.command("token", "create", name, "--role", role).split()[-1]

    def start(self) -> None:
        """Start and wait until requests are answered."""
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                [*self._command, "serve", "--port", str(self.port)],
                cwd=self._folder,
                env=self._environment,
                stderr=log,
                stdout=log,
            )
        end = time.monotonic() + START_LIMIT_S
        while time.monotonic() < end and self._process.poll() is None:
            with contextlib.suppress(httpx.TransportError):
                if self._http.get("/api/v1/health/live").is_success:
                    return
            time.sleep(GLANCE_S)
        self.kill()
        raise AssertionError(f"the service did not start:\n{self._log.read_text()}")

    def kill(self) -> None:
        """End the process without any warning to it."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    @property
    def pid(self) -> int:
        """Of the running process."""
        assert self._process is not None
        return self._process.pid

    def get(self, path: str) -> Any:
        answer = self._http.get(f"/api/v1{path}")
        return answer.raise_for_status().json()

    def post(self, path: str, content: dict[str, Any]) -> Any:
        answer = self._http.post(f"/api/v1{path}", json=content)
        return answer.raise_for_status().json()

    def send_log(self, mission: str, log: Path, vehicle: str) -> None:
        """Send a vehicle's log, which is read from then on."""
        params = {"filename": log.name, "vehicle": vehicle}
        answer = self._http.post(f"/api/v1/missions/{mission}/logs", content=log.read_bytes(), params=params)
        answer.raise_for_status()

    def create(self, **changes: Any) -> str:
        """Describe a mission over the API, without what is None, and return its id."""
        spec = {
            "name": "Harbour basin",
            "area": AREA,
            "steps": 400,
            "vehicles": [{"name": "sim-1", "kind": "sim", "sensor": "dvl"}],
            "planner": {"name": "random"},
        }
        told = {name: value for name, value in (spec | changes).items() if value is not None}
        answer = self._http.post("/api/v1/missions", json=told)
        return str(answer.raise_for_status().json()["id"])

    def act(self, mission: str, action: str) -> None:
        self._http.post(f"/api/v1/missions/{mission}/{action}").raise_for_status()
