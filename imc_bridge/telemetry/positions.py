"""Where a vehicle says that it is."""

from __future__ import annotations

import math

from imcpy.coordinates import toWGS84

from imc_bridge.network.codec import Message


def told_place(message: Message) -> tuple[float, float] | None:
    """Return latitude and longitude of an EstimatedState, radians; None where it holds no position.

    Before its first fix DUNE is at 0, 0; a navigation that has failed tells no numbers.
    """
    if message.lat == 0.0 and message.lon == 0.0:
        return None
    lat, lon, _height = toWGS84(message)
    if not all(map(math.isfinite, (lat, lon, message.depth))) or abs(lat) > math.pi / 2:
        return None
    return lat, lon
