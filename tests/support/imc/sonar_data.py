"""SonarData of a multibeam as IMC lays it out, written value by value."""

import struct
from collections.abc import Sequence

import imcpy

WIDTH_RAD = 0.01


def sonar_data(
    points: Sequence[int],
    *,
    bits: int = 16,
    scale: float = 0.01,
    start_rad: float = -1.0,
    width_rad: float = WIDTH_RAD,
    steps: Sequence[int] | None = None,
    step_scale: float = 1e-4,
    intensities: Sequence[int] | None = None,
    range_m: tuple[int, int] = (0, 0),
) -> imcpy.Message:
    """A multibeam's ranges of ``points`` times ``scale`` metres, and if given angle steps and intensities."""
    message = imcpy.SonarData()
    message.type = imcpy.SonarData.TypeEnum.MULTIBEAM
    message.bits_per_point, message.scale_factor = bits, scale
    message.min_range, message.max_range = range_m
    beam = imcpy.BeamConfig()
    beam.beam_width = width_rad
    message.beam_config.append(beam)
    data = struct.pack("<HfB", len(points), start_rad, (intensities is not None) | (steps is not None) << 1)
    if steps is not None:
        data += struct.pack("<f", step_scale)
    if intensities is not None:
        data += struct.pack("<f", 1.0)
    for step in steps or ():
        data += struct.pack("<H", step)
    for value in (*points, *(intensities or ())):
        data += value.to_bytes(bits // 8, "little")
    message.data = data
    return message
