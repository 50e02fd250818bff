"""Writes LSF logs as DUNE does, over a sea floor that is known exactly."""

import gzip
import math
from collections.abc import Iterator
from pathlib import Path

import imcpy
import numpy as np
from imcpy.coordinates import WGS84

from imc_bridge.network.codec import encode
from tests.support.imc.sonar_data import sonar_data

VEHICLE_ID, OTHER_ID = 0x1E, 0x1F
NAME = "lauv-log-1"
ALTIMETER, FORWARD, MULTIBEAM, PROBE = 58, 59, 60, 61
LAT_RAD, LON_RAD = math.radians(41.185), math.radians(-8.705)
START_S = 1_795_225_140.0
SPEED_MPS = 1.5
STATE_PERIOD_S, PING_PERIOD_S = 0.1, 0.2
VEHICLE_DEPTH_M = 2.0
BEAMS, START_RAD, WIDTH_RAD = 9, -0.8, 0.2


def bottom_m(north_m: float) -> float:
    """Depth of the sea floor along the track."""
    return 12.0 + 2.0 * math.sin(north_m / 20.0)


def packet(message: object, time_s: float, src: int = VEHICLE_ID, entity: int = 0) -> bytes:
    data = bytearray(encode(message, src=src, dst=0xFFFF, time_s=time_s))
    if not entity:
        return bytes(data)
    again = imcpy.Packet.deserialize(bytes(data))
    again.src_ent = entity
    return bytes(imcpy.Packet.serialize(again))


def state(time_s: float, north_m: float, src: int = VEHICLE_ID, depth_m: float = VEHICLE_DEPTH_M) -> bytes:
    message = imcpy.EstimatedState()
    message.lat, message.lon = WGS84.displace(LAT_RAD, LON_RAD, north_m, 5.0)
    message.depth = depth_m
    message.vx = SPEED_MPS
    message.alt = -1.0
    return packet(message, time_s, src)


def distance(
    time_s: float, value: float, *, valid: bool = True, entity: int = ALTIMETER, src: int = VEHICLE_ID
) -> bytes:
    message = imcpy.Distance()
    message.validity = imcpy.Distance.ValidityEnum.VALID if valid else imcpy.Distance.ValidityEnum.INVALID
    message.value = value
    return packet(message, time_s, src, entity)


def ping(time_s: float, height_m: float) -> bytes:
    """Of a multibeam over flat ground."""
    angles = START_RAD + WIDTH_RAD * np.arange(BEAMS)
    points = np.round(100.0 * height_m / np.cos(angles)).astype(int).tolist()
    return packet(sonar_data(points, start_rad=START_RAD, width_rad=WIDTH_RAD), time_s, entity=MULTIBEAM)


def sound_speed(time_s: float, value: float, src: int = VEHICLE_ID) -> bytes:
    """Of a probe."""
    message = imcpy.SoundSpeed()
    message.value = value
    return packet(message, time_s, src, PROBE)


def sound_speed_mps(depth_m: float) -> float:
    """What it is where vehicles of these logs dive."""
    return 1512.0 - 0.5 * depth_m


def dive_depth_m(after_s: float, deepest_m: float, seconds: int) -> float:
    """How deep a vehicle is that long after a dive began."""
    return deepest_m * (1.0 - abs(2.0 * after_s / seconds - 1.0))


def dive(begin_s: float, deepest_m: float, seconds: int) -> Iterator[bytes]:
    """Down and up again, evenly, with a speed of sound each second and one that is none."""
    for tick in range(seconds):
        time_s = begin_s + tick
        yield state(time_s, 0.0, depth_m=dive_depth_m(tick, deepest_m, seconds))
        yield sound_speed(time_s + 0.1, sound_speed_mps(dive_depth_m(tick + 0.1, deepest_m, seconds)))
        yield sound_speed(time_s + 0.2, -1.0)
    yield state(begin_s + seconds, 0.0, depth_m=0.0)


def announce(time_s: float, name: str = NAME, src: int = VEHICLE_ID) -> bytes:
    message = imcpy.Announce()
    message.sys_name = name
    message.sys_type = imcpy.SystemType.UUV
    message.services = "dune://0.0.0.0/uid/1;imc+info://0.0.0.0/version/5.4.31;imc+udp://127.0.0.1:6002/"
    return packet(message, time_s, src)


def entities(time_s: float) -> bytes:
    message = imcpy.EntityList()
    message.op = imcpy.EntityList.OperationEnum.REPORT
    message.list = f"Daemon=0;Altimeter={ALTIMETER};Echo Sounder={FORWARD};Multibeam={MULTIBEAM};CTD={PROBE}"
    return packet(message, time_s)


def survey(pings: int) -> Iterator[bytes]:
    """A line due north: states at 10 Hz, pings at 5 Hz, everything valid."""
    yield entities(START_S)
    yield announce(START_S)
    for tick in range(pings * round(PING_PERIOD_S / STATE_PERIOD_S) + 2):
        time_s = START_S + tick * STATE_PERIOD_S
        north_m = SPEED_MPS * (time_s - START_S)
        yield state(time_s, north_m)
        if tick % 2 == 0 and tick // 2 < pings:
            # Between two states, where only interpolation places it right.
            at_s = time_s + 0.4 * STATE_PERIOD_S
            yield distance(at_s, bottom_m(SPEED_MPS * (at_s - START_S)) - VEHICLE_DEPTH_M)


def write(path: Path, packets: Iterator[bytes] | list[bytes], *, cut_bytes: int = 0) -> Path:
    data = b"".join(packets)
    data = data[: len(data) - cut_bytes]
    path.write_bytes(gzip.compress(data, 1, mtime=0) if path.suffix == ".gz" else data)
    return path
