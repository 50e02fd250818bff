import asyncio
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from typing import Any

import httpx
import numpy as np

from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.main import Server, serve
from app.settings import Settings
from tests.support.missions.specs import AREA


def mission_spec(**changes: Any) -> dict[str, Any]:
    return {
        "name": "Harbour basin",
        "area": AREA,
        "steps": 3,
        "cell_m": 2,
        "vehicles": [{"name": "rover", "kind": "rest"}],
        "planner": {"name": "random"},
    } | changes


def soundings(count: int = 12, vehicle: str = "rover", start_s: float = 1_795_225_140.0) -> list[dict[str, Any]]:
    """Soundings along the area's diagonal, one a second, 2 m apart."""
    return [
        {
            "vehicle": vehicle,
            "time_s": start_s + i,
            "lat_deg": 41.1851 + 0.00001 * i,
            "lon_deg": -8.7049 + 0.00002 * i,
            "depth_m": 2.0,
            "range_m": 8.0 + 0.1 * i,
        }
        for i in range(count)
    ]


@asynccontextmanager
async def running(settings: Settings) -> AsyncIterator[Server]:
    """The real server on a free port, in this process."""
    started: asyncio.Future[Server] = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(serve(settings, started=started.set_result))
    both: set[asyncio.Future[Any]] = {task, started}
    await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
    if not started.done():
        started.cancel()
        await task
    server = started.result()
    try:
        yield server
    finally:
        server.stop()
        await task


def make_client(server: Server) -> httpx.AsyncClient:
    # Loading the certificates that plain HTTP does not need would take longer than most tests.
    return httpx.AsyncClient(base_url=server.url + "/api/v1", timeout=20, verify=False)  # noqa: S501


@contextmanager
def running_in_thread(settings: Settings) -> Iterator[Server]:
    """The real server in a thread of its own, for fixtures that outlive one event loop."""
    started: dict[str, Server] = {}
    answers = threading.Event()

    def note(server: Server) -> None:
        started["server"] = server
        answers.set()

    thread = threading.Thread(target=lambda: asyncio.run(serve(settings, started=note)))
    thread.start()
    assert answers.wait(120)
    try:
        yield started["server"]
    finally:
        started["server"].stop()
        thread.join(30)


@dataclass(kw_only=True)
class Tokens:
    """One token of each role, by the role, and one of the vehicle ``rover``."""

    store: TokenStore
    tokens: dict[str, str]

    def as_(self, name: str) -> dict[str, str]:
        """Headers that show a token."""
        return {"Authorization": f"Bearer {self.tokens[name]}"}


async def make_tokens(store: TokenStore) -> dict[str, str]:
    """Tokens as :class:`Tokens` has them."""
    tokens = {role.value: (await store.create(f"the {role}", role))[1] for role in Role}
    return tokens | {"rover": (await store.create("rover", Role.VEHICLE, vehicle="rover"))[1]}


@dataclass(kw_only=True)
class Guarded(Tokens):
    """A service with tokens."""

    server: Server
    client: httpx.AsyncClient


async def new_mission(guarded: Guarded) -> str:
    """Path of a new mission."""
    answer = await guarded.client.post("/missions", json=mission_spec(), headers=guarded.as_("operator"))
    assert answer.status_code == 201, answer.text
    return f"/missions/{answer.json()['id']}"


def prior_text(n: int = 30, depth_m: float = 9.0) -> bytes:
    rng = np.random.default_rng(1)
    rows = np.column_stack([rng.uniform(0, 55, n), rng.uniform(0, 55, n), np.full(n, depth_m), np.full(n, 0.4)])
    return b"east_m,north_m,depth_m,sd_m\n" + "\n".join(",".join(map(repr, map(float, row))) for row in rows).encode()
