"""From the frame of a vehicle to that of its surroundings."""

from __future__ import annotations

import math

import numpy as np

from simulator.arrays import FloatArray


def to_local_frame(body: FloatArray, heading_rad: float, pitch_rad: float, roll_rad: float) -> FloatArray:
    """Turn body vectors (forward, starboard, down) into (east, north, down), shape (n, 3) each."""
    cr, sr = math.cos(roll_rad), math.sin(roll_rad)
    cp, sp = math.cos(pitch_rad), math.sin(pitch_rad)
    ch, sh = math.cos(heading_rad), math.sin(heading_rad)
    x, y, z = body[:, 0], body[:, 1], body[:, 2]
    y, z = cr * y - sr * z, sr * y + cr * z
    x, z = cp * x + sp * z, -sp * x + cp * z
    return np.column_stack([sh * x + ch * y, ch * x - sh * y, z])
