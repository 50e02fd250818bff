import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any

import numpy as np
import pytest

from simulator.network import NetworkFaults, UdpEndpoint
from tests.support.waiting import until


@pytest.fixture
async def udp() -> AsyncIterator[Any]:
    """Opens endpoints that remember what came, and closes them in the end."""
    opened = []

    async def opening(faults: Any = None, seed: int = 0) -> Any:
        came = []
        endpoint = await UdpEndpoint.open(
            ("127.0.0.1", 0),
            lambda data, address: came.append(data),
            faults=faults,
            rng=np.random.default_rng(seed),
        )
        opened.append(endpoint)
        return endpoint, came

    yield opening
    for endpoint in opened:
        endpoint.close()
    await asyncio.sleep(0)


@pytest.fixture
def pair(udp: Any) -> Any:
    """Opens a faulty sender and a perfect receiver that remembers what came."""

    async def opening(faults: Any, seed: int = 0) -> Any:
        sender, _ = await udp(faults, seed)
        receiver, came = await udp()
        return sender, receiver, came

    return opening


async def send_numbers(sender: UdpEndpoint, receiver: UdpEndpoint, n: int) -> None:
    for k in range(n):
        sender.send(k.to_bytes(2, "big"), receiver.address)
        await asyncio.sleep(0)


def numbers(came: list[bytes]) -> list[int]:
    return [int.from_bytes(data, "big") for data in came]


async def test_a_perfect_network_delivers_everything_in_order(pair: Callable[..., Any]) -> None:
    sender, receiver, came = await pair(NetworkFaults())
    await send_numbers(sender, receiver, 50)
    await until(lambda: len(came) == 50, "50 packets came")
    assert numbers(came) == list(range(50))


async def test_losses_happen_at_their_rate_and_by_seed(pair: Callable[..., Any]) -> None:
    lost = []
    for seed in (5, 5, 6):
        sender, receiver, came = await pair(NetworkFaults(loss=0.3), seed)
        await send_numbers(sender, receiver, 300)
        await until(lambda: len(came) == 300 - sender.counts.lost, "all packets came")  # noqa: B023
        lost.append(sorted(set(range(300)) - set(numbers(came))))
    assert lost[0] == lost[1] != lost[2]
    assert 60 < len(lost[0]) < 120


async def test_duplicates_arrive_twice(pair: Callable[..., Any]) -> None:
    sender, receiver, came = await pair(NetworkFaults(duplicate=1.0))
    await send_numbers(sender, receiver, 20)
    await until(lambda: len(came) == 40, "40 packets came")
    assert sorted(numbers(came)) == sorted([*range(20)] * 2)


async def test_reordered_packets_are_overtaken(pair: Callable[..., Any]) -> None:
    sender, receiver, came = await pair(NetworkFaults(reorder=0.3, hold_s=0.02))
    await send_numbers(sender, receiver, 60)
    await until(lambda: len(came) == 60, "60 packets came")
    assert sorted(numbers(came)) == list(range(60))
    assert numbers(came) != list(range(60))


async def test_delayed_packets_come_later(pair: Callable[..., Any]) -> None:
    sender, receiver, came = await pair(NetworkFaults(delay_s=0.05))
    loop = asyncio.get_running_loop()
    before = loop.time()
    sender.send(b"x", receiver.address)
    await until(lambda: came, "a packet came")
    assert loop.time() - before >= 0.05


async def test_closing_forgets_what_is_under_way(pair: Callable[..., Any], udp: Callable[..., Any]) -> None:
    sender, receiver, came = await pair(NetworkFaults(delay_s=0.01))
    sender.send(b"x", receiver.address)
    sender.close()
    sender.send(b"y", receiver.address)
    other, _ = await udp()
    other.send(b"z", receiver.address)
    await until(lambda: came, "a packet came")
    assert came == [b"z"]


async def test_what_is_received_suffers_too(udp: Callable[..., Any]) -> None:
    receiver, came = await udp(NetworkFaults(loss=1.0))
    sender, _ = await udp()
    sender.send(b"x", receiver.address)
    await until(lambda: receiver.counts.lost == 1, "one packet is lost")
    assert came == []


async def test_a_port_is_taken_exclusively(udp: Callable[..., Any]) -> None:
    first, _ = await udp()
    with pytest.raises(OSError, match="in use"):
        await UdpEndpoint.open(first.address, lambda data, address: None)


@pytest.mark.parametrize(
    ("kwargs", "message"), [({"loss": 2.0}, "loss is 2.0"), ({"delay_s": -1.0}, "delay_s is -1.0")]
)
def test_impossible_networks_are_refused(kwargs: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        NetworkFaults(**kwargs)
