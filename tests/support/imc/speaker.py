"""A system on the network of the vehicles that says what it is told to."""

import socket
from typing import Any

import imcpy

from imc_bridge.bridge import Bridge

VEHICLE = 0x1E


PLACE = (0.7188, -0.1520)
"""Radians, in the harbour of Leixoes."""


class Speaker:
    """A system that says what it is told to, from an address and with a clock of its own."""

    def __init__(
        self, bridge: Bridge, host: str = "127.0.0.1", imc_id: int = VEHICLE, name: str = "lauv-noptilus-1"
    ) -> None:
        self.bridge, self.imc_id, self.name = bridge, imc_id, name
        self.time_s = 1.7e9
        self.sent: list[Any] = []
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.bind((host, 0))

    def packet(self, message: imcpy.Message) -> bytes:
        self.time_s += 0.1
        message.src, message.dst, message.timestamp = self.imc_id, 0xFFFF, self.time_s
        return imcpy.Packet.serialize(message)

    def send(self, message: imcpy.Message) -> None:
        self.throw(self.packet(message))

    def throw(self, packet: bytes, port: int | None = None) -> None:
        self.sent.append((packet, port))
        self.sock.sendto(packet, ("127.0.0.1", port or self.bridge.settings.port))

    def announce(self, address: tuple[str, int] | None = None, uid: int = 1) -> None:
        host, port = address or self.sock.getsockname()
        message = imcpy.Announce()
        message.sys_name, message.sys_type = self.name, imcpy.SystemType.UUV
        message.services = f"dune://0.0.0.0/uid/{uid};imc+info://0.0.0.0/version/5.4.31;imc+udp://{host}:{port}/"
        self.throw(self.packet(message), self.bridge.transport.announce_port)

    def state(self, north_m: float = 0.0, depth_m: float = 1.0) -> None:
        message = imcpy.EstimatedState()
        message.lat, message.lon, message.x, message.depth = *PLACE, north_m, depth_m
        self.send(message)

    def measure(self, range_m: float) -> None:
        message = imcpy.Distance()
        message.validity, message.value, message.src_ent = imcpy.Distance.ValidityEnum.VALID, range_m, 7
        self.send(message)

    def swim(self, seconds: float = 1.0) -> None:
        """Report itself on its way north, with a sounding between any two states."""
        entities = imcpy.EntityList()
        entities.op, entities.list = imcpy.EntityList.OperationEnum.REPORT, "Altimeter=7"
        self.send(entities)
        for k in range(round(seconds * 5)):
            self.state(north_m=0.3 * k)
            self.measure(10.0)
        self.state(north_m=0.3 * round(seconds * 5))

    def close(self) -> None:
        self.sock.close()
