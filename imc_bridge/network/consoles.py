"""What other consoles are shown of a mission: its area's corners and where the vehicles are sent.

Neptus draws any system named in a RemoteSensorInfo as an external system on its map, by its id. There is no IMC
message that makes it show an area or another console's plan unasked, so positions are all that it gets.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import imcpy

from imc_bridge.network.codec import Message

SHOW_PERIOD_S = 5.0
MAX_MARKS = 64


@dataclass(frozen=True, slots=True)
class Mark:
    """A place on other consoles' maps."""

    kind: str
    lat_deg: float
    lon_deg: float
    depth_m: float = 0.0


class Board:
    """The marks to show, by the name under which they appear.

    Parameters
    ----------
    owner
        Our own name, which every mark's begins with: one that is named like a vehicle would move that vehicle.
    """

    def __init__(self, owner: str) -> None:
        self._owner = owner
        self._marks: dict[str, Mark] = {}
        self._due = 0.0

    def show(self, name: str, mark: Mark | None) -> None:
        """Show a mark, or no longer."""
        if mark is None:
            self._marks.pop(name, None)
        elif name in self._marks or len(self._marks) < MAX_MARKS:
            self._marks[name] = mark

    @property
    def marks(self) -> Mapping[str, Mark]:
        """What is shown now."""
        return self._marks

    def due(self, now: float) -> list[Message]:
        """The messages to send to every console now, if it is time."""
        if now < self._due or not self._marks:
            return []
        self._due = now + SHOW_PERIOD_S
        return [remote_info(f"{self._owner} {name}", mark) for name, mark in self._marks.items()]


def remote_info(name: str, mark: Mark) -> Message:
    """A mark as Neptus takes it up."""
    message = imcpy.RemoteSensorInfo()
    message.id = name
    message.sensor_class = mark.kind
    message.lat = math.radians(mark.lat_deg)
    message.lon = math.radians(mark.lon_deg)
    message.alt = -mark.depth_m
    message.heading = 0.0
    message.data = ""
    return message
