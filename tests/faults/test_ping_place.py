"""Files of pings are on a machine that does not answer: missions are taken up and vehicles led all the same."""

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest

from tests.support.api.rest import mission_spec
from tests.support.faults.service import Service, service_in
from tests.support.missions.pings import posted_ping
from tests.support.waiting import until


class SilentServer:
    """Takes connections and says nothing."""

    def __init__(self) -> None:
        self.writers: list[asyncio.StreamWriter] = []
        self.port = 0

    def take(self, _reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Keep a connection."""
        self.writers.append(writer)


@pytest.fixture
async def silent() -> AsyncIterator[SilentServer]:
    made = SilentServer()
    server = await asyncio.start_server(made.take, "127.0.0.1", 0)
    made.port = server.sockets[0].getsockname()[1]
    try:
        yield made
    finally:
        server.close()
        for writer in made.writers:
            writer.close()


async def mission_with_pings(api: httpx.AsyncClient) -> str:
    """A running mission in which pings are stored."""
    vehicles = [{"name": "rover", "kind": "rest", "sensor": "multibeam"}]
    mission_id: str = (await api.post("/missions", json=mission_spec(vehicles=vehicles))).json()["id"]
    answer = await api.post(f"/missions/{mission_id}/measurements", json={"items": [posted_ping(0), posted_ping(1)]})
    assert answer.json()["accepted"] == 2, answer.text
    begun = await api.post(f"/missions/{mission_id}/start")
    assert begun.status_code == httpx.codes.OK, begun.text
    return mission_id


@pytest.mark.slow
async def test_a_mission_is_taken_up_while_the_place_of_its_pings_does_not_answer(
    tmp_path: Path, silent: SilentServer
) -> None:
    async with service_in(tmp_path) as (service, api):
        mission_id = await mission_with_pings(api)
        await service.kill()
        elsewhere = {"PINGS_URL": f"ftp://127.0.0.1:{silent.port}/pings"}
        again = Service(tmp_path, settings=elsewhere, port=service.port)
        await again.start()
        try:
            await again.await_ready(api)
            assert '"mission taken up"' in again.said
            assert "could not be looked for" not in again.said, "it does not answer yet"
            assert (await api.get(f"/missions/{mission_id}")).json()["state"] == "running"
            await until(lambda: silent.writers, "the files are asked for")

            def given_up() -> int:
                for writer in silent.writers:
                    writer.close()
                return again.said.count("could not be looked for")

            await until(lambda: given_up() >= 2, "what is wrong with them is told")
            assert await again.end() == 0
            assert "acknowledged the stop" in again.said
        finally:
            if again.process is not None and again.process.returncode is None:
                await again.kill()


@pytest.mark.slow
async def test_a_service_ends_while_the_place_of_its_pings_never_answers(tmp_path: Path, silent: SilentServer) -> None:
    async with service_in(tmp_path) as (service, api):
        mission_id = await mission_with_pings(api)
        await service.kill()
        elsewhere = {"PINGS_URL": f"ftp://127.0.0.1:{silent.port}/pings"}
        forever = {"FTP_TIMEOUT_S": "100000"}
        again = Service(tmp_path, settings=elsewhere, world=forever, port=service.port)
        await again.start()
        try:
            await again.await_ready(api)
            await until(lambda: silent.writers, "the files are asked for")
            assert await again.end() == 0
            assert "acknowledged the stop" in again.said
            assert again.rows("select state from missions where id = ?", mission_id) == [("running",)]
        finally:
            if again.process is not None and again.process.returncode is None:
                await again.kill()
