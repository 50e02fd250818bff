"""Sentences over real sockets and files."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from app.missions.settings import AisSettings
from app.missions.traffic.sources import LineSplitter, UdpSource
from app.missions.traffic.watch import MOST_PER_TICK, MOST_WAITING, Traffic
from app.missions.views.traffic import traffic_findings
from imc_bridge.doctor.diagnosis import Severity
from tests.support.missions.ais import CLASS_A, RECORDED, STATIC, named, nmea, position
from tests.support.waiting import until


@asynccontextmanager
async def listening(**settings: Any) -> AsyncIterator[Traffic]:
    traffic = Traffic(AisSettings.model_validate(settings))
    await traffic.start()
    try:
        yield traffic
    finally:
        await traffic.close()


def send(port: int, *datagrams: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for datagram in datagrams:
            sender.sendto(datagram, ("127.0.0.1", port))


async def udp_port(traffic: Traffic) -> int:
    [source] = traffic.sources
    assert isinstance(source, UdpSource)
    await until(lambda: not source.trouble, "the port is open")
    return source.port


async def test_ships_are_heard_by_udp() -> None:
    async with listening(udp_address="127.0.0.1", udp_port=0) as traffic:
        port = await udp_port(traffic)
        send(port, CLASS_A + b"\r\n", b"\r\n".join(RECORDED) + b"\r\n", b"UdPbC\x00" + STATIC[0], STATIC[1], b"rubbish")
        await until(lambda: traffic.malformed == 1 and len(traffic.ship_list) >= 5, "all were read")
        assert traffic.ship_list.get(367380120) is not None
        [state] = traffic.states()
        assert (state.trouble, state.sentences) == ("", len(RECORDED) + 3)
        assert [found.severity for found in traffic_findings(traffic)] == [Severity.OK]


async def test_a_flood_is_read_at_a_pace_and_fills_no_memory() -> None:
    async with listening(udp_address="127.0.0.1", udp_port=0) as traffic:
        [source] = traffic.sources
        for number in range(3 * MOST_WAITING):
            traffic._put(position(200_000_000 + number, 41.0, -8.0), source)
        assert traffic.dropped == 2 * MOST_WAITING
        traffic._take_some()
        assert len(traffic.ship_list) == MOST_PER_TICK


async def test_a_port_that_is_taken_is_said_and_tried_again() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        async with listening(udp_address="127.0.0.1", udp_port=port) as traffic:
            await until(lambda: "in use" in traffic.states()[0].trouble, "it is said")
            [finding] = traffic_findings(traffic)
            assert finding.severity is Severity.PROBLEM
            other.close()
            assert await udp_port(traffic) == port


async def test_ships_are_heard_from_a_server_that_breaks_off_in_the_middle_of_a_sentence() -> None:
    connections = 0

    async def serve(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal connections
        connections += 1
        if connections == 1:
            writer.write(position(211000001, 41.0, -8.0) + b"\n" + CLASS_A[:20])
        else:
            whole = b"\n".join(named(211000001, "EVA")) + b"\n"
            writer.write(whole[:37])
            await writer.drain()
            writer.write(whole[37:])
        await writer.drain()
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    async with server, listening(tcp_host="127.0.0.1", tcp_port=server.sockets[0].getsockname()[1]) as traffic:

        def is_named() -> bool:
            ship = traffic.ship_list.get(211000001)
            return ship is not None and ship.particulars.name == "EVA"

        await until(is_named, "it connected again, and was told the name")
        assert traffic.malformed == 0


async def test_nobody_serving_is_said() -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    async with listening(tcp_host="127.0.0.1", tcp_port=port) as traffic:
        await until(lambda: "refused" in traffic.states()[0].trouble.lower(), "it is said")


async def test_a_file_is_read_on_from_its_end_and_anew_when_it_is_replaced(tmp_path: Path) -> None:
    file = tmp_path / "ais.log"
    file.write_bytes(CLASS_A + b"\n")
    async with listening(file=str(file)) as traffic:
        await until(lambda: not traffic.states()[0].trouble, "it is open")
        with file.open("ab") as log:
            log.write(position(211000001, 41.0, -8.0) + b"\n")
        await until(lambda: traffic.ship_list.get(211000001), "what was added is read")
        assert traffic.ship_list.get(367380120) is None, "that was said before"
        fresh = tmp_path / "fresh"
        fresh.write_bytes(position(211000002, 41.0, -8.0) + b"\n")
        fresh.replace(file)
        await until(lambda: traffic.ship_list.get(211000002), "the new file is read")


async def test_a_file_that_is_not_there_yet_is_waited_for(tmp_path: Path) -> None:
    file = tmp_path / "ais.log"
    async with listening(file=str(file)) as traffic:
        await until(lambda: "No such file" in traffic.states()[0].trouble, "it is said")


@pytest.mark.parametrize("size", [1, 7, 4096])
def test_lines_are_put_together_from_pieces_of_any_size(size: int) -> None:
    said = b"\r\n".join([CLASS_A, b"x" * 5000, *STATIC]) + b"\n"
    lines, found = LineSplitter(), []
    for begin in range(0, len(said), size):
        found += lines.cut(said[begin : begin + size])
    assert found[0] == CLASS_A
    assert tuple(found[-2:]) == STATIC
    assert len(found) <= 4


async def test_silence_is_told() -> None:
    async with listening(udp_address="127.0.0.1", udp_port=0) as traffic:
        await udp_port(traffic)
        [finding] = traffic_findings(traffic)
        assert finding.severity is Severity.NOTE
        assert "nothing was heard" in finding.text


async def test_other_instruments_on_the_same_wire_are_no_ais_that_is_heard() -> None:
    async with listening(udp_address="127.0.0.1", udp_port=0) as traffic:
        await udp_port(traffic)
        [source] = traffic.sources
        for sentence in ("GPGSV,1,1,01,21,00,000,", "GPZDA,120000.00,29,11,2026,00,00", "SDDPT,3.4,0.0"):
            traffic._put(nmea(sentence), source)
        traffic._take_some()
        [finding] = traffic_findings(traffic)
        assert (traffic.malformed, finding.severity) == (0, Severity.NOTE)
        assert "nothing was heard" in finding.text


async def test_without_settings_nothing_listens() -> None:
    async with listening() as traffic:
        assert not traffic.listens
        assert traffic_findings(traffic) == []
