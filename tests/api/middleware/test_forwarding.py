"""Bodies that are sent on to the process that has the mission: whole, bounded, and not in memory."""

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any

import httpx
import pytest

from app.api.http import spool
from app.api.http.spool import Spool
from app.main import Server
from app.settings import Settings
from tests.support.api.rest import make_client, mission_spec, running, soundings

KIB = 1024


@pytest.fixture
async def two(make_settings: Callable[..., Settings]) -> AsyncIterator[tuple[Server, Server]]:
    """Two services on one database."""
    settings = make_settings(slow_client_s=5, max_import_bytes=3_000_000)
    async with running(settings) as first, running(settings) as second:
        yield first, second


def xyz(lines: int) -> bytes:
    """Soundings in the mission's own frame."""
    return b"".join(b"%.2f %.2f %.2f\n" % (5 + i % 400 * 0.1, 5 + i // 400 * 0.05, 6.0) for i in range(lines))


@pytest.mark.slow
async def test_a_file_and_a_batch_reach_the_process_that_has_the_mission(
    two: tuple[Server, Server], monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes: list[int] = []
    fill = Spool.fill

    async def noted(self: Spool, receive: Any) -> None:
        await fill(self, receive)
        sizes.append(self.size)

    monkeypatch.setattr(Spool, "fill", noted)
    first, second = two
    async with make_client(first) as at_first, make_client(second) as at_second:
        mission = f"/missions/{(await at_first.post('/missions', json=mission_spec())).json()['id']}"
        # A heartbeat later the other process knows who is there.
        async with asyncio.timeout(60):
            while (await at_second.get(mission)).status_code != httpx.codes.OK:  # noqa: ASYNC110 - as clients do
                await asyncio.sleep(0.05)
        file = xyz(20_000)
        options: dict[str, Any] = {"filename": "old.xyz", "crs": "local", "sd_m": 0.1, "positive": "down"}
        assert len(file) > spool.MEMORY_BYTES
        sent = await at_second.post(f"{mission}/imports", params=options, content=file)
        assert sent.status_code == httpx.codes.CREATED, sent.text
        assert sizes == [len(file)]
        items = [soundings(1, start_s=1_795_225_140.0 + 0.1 * i)[0] for i in range(3000)]
        sent = await at_second.post(f"{mission}/measurements", json={"items": items})
        assert (sent.status_code, sent.json()["accepted"]) == (200, 3000)
        assert len(sizes) == 2
        too_long = await at_second.post(f"{mission}/imports", params=options, content=parts(4_000_000))
        assert too_long.status_code == httpx.codes.REQUEST_ENTITY_TOO_LARGE
        nowhere = await at_second.post(f"{mission}/nowhere", content=file)
        assert nowhere.status_code == httpx.codes.NOT_FOUND
        assert len(sizes) == 2
        read = await at_second.request("GET", mission, content=file)
        assert read.status_code == httpx.codes.OK
        assert len(sizes) == 2


async def parts(size: int) -> AsyncIterator[bytes]:
    for _ in range(0, size, 64 * KIB):
        yield b"1" * 64 * KIB


@pytest.mark.parametrize("size", [0, 10, spool.MEMORY_BYTES, 3 * spool.MEMORY_BYTES + 1])
async def test_a_spooled_body_can_be_read_again(size: int) -> None:
    body = bytes(i % 251 for i in range(size))
    left = [body[i : i + 60_000] for i in range(0, size, 60_000)] or [b""]

    async def receive() -> dict[str, Any]:
        if not left:
            return {"type": "http.disconnect"}
        return {"type": "http.request", "body": left.pop(0), "more_body": bool(left)}

    spooled = Spool(None)
    try:
        await spooled.fill(receive)
        for _ in range(2):
            assert b"".join([part async for part in spooled.parts()]) == body
        replay, found, more = spooled.replayed(receive), b"", True
        while more:
            message = await replay()
            found, more = found + message["body"], message["more_body"]
        assert found == body
        assert (await replay())["type"] == "http.disconnect"
    finally:
        spooled.close()
