"""References: the commanded position of a vehicle that follows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import imcpy

from imc_bridge.control.plans import SPEED_METERS_PS, Z_DEPTH
from imc_bridge.network.codec import Message

FLAG_LOCATION = 0x01
FLAG_SPEED = 0x02
FLAG_Z = 0x04
FLAG_RADIUS = 0x08
FLAG_DIRECT = 0x20
REFERENCE_FLAGS = FLAG_LOCATION | FLAG_SPEED | FLAG_Z | FLAG_DIRECT


@dataclass(frozen=True, slots=True)
class SentReference:
    """The fields of a Reference that its echo is compared by."""

    lat_rad: float
    lon_rad: float
    depth_m: float
    speed_mps: float
    radius_m: float = 0.0

    def echoed_by(self, message: Message | None) -> bool:
        """Whether FollowRefState's reference is this one (floats of 32 bits on the wire)."""
        return (
            isinstance(message, imcpy.Reference)
            and isinstance(message.z, imcpy.DesiredZ)
            and int(message.z.z_units) == Z_DEPTH
            and math.isclose(message.lat, self.lat_rad, abs_tol=1e-10)
            and math.isclose(message.lon, self.lon_rad, abs_tol=1e-10)
            and math.isclose(message.z.value, self.depth_m, abs_tol=1e-3)
        )

    def message(self) -> Message:
        """The Reference to send."""
        speed = imcpy.DesiredSpeed()
        speed.value = self.speed_mps
        speed.speed_units = SPEED_METERS_PS
        z = imcpy.DesiredZ()
        z.value = self.depth_m
        z.z_units = Z_DEPTH
        reference = imcpy.Reference()
        reference.flags = REFERENCE_FLAGS | (FLAG_RADIUS if self.radius_m else 0)
        reference.speed = speed
        reference.z = z
        reference.lat = self.lat_rad
        reference.lon = self.lon_rad
        reference.radius = self.radius_m
        return reference
