from collections.abc import AsyncIterator
from typing import Any

import pytest

from imc_bridge import Bridge, BridgeSettings
from tests.support.imc.sea import Peer
from tests.support.ports import free_ports


@pytest.fixture
async def harbour() -> AsyncIterator[Any]:
    """A started bridge and a peer that it does not know yet."""
    *announce_ports, port = free_ports(4)
    settings = BridgeSettings(port=port, loopback_only=True, announce_ports=tuple(announce_ports), time_scale=20.0)
    bridge = Bridge(settings)
    events: list[Any] = []
    await bridge.start(events.append)
    peer = Peer(settings)
    yield bridge, peer
    peer.close()
    await bridge.close()
