"""How fast sound is in the water around a vehicle: as a probe tells, or from a CTD's temperature and salinity.

A sound velocity probe, and DUNE for most CTDs, sends SoundSpeed. Where one entity sends Temperature and Salinity
without it, the speed follows from the equation of state of sea water (TEOS-10, :func:`gsw.sound_speed_t_exact`) at the
depth that the vehicle had at that time; electronics and batteries report temperatures without a salinity.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import gsw

from imc_bridge.events import SoundSpeedSample
from imc_bridge.network.codec import Message
from imc_bridge.telemetry.soundings import Awaiting, Repeats, StateHistory

MESSAGES = ("Salinity", "SoundSpeed", "Temperature")

SLOWEST_MPS, FASTEST_MPS = 1350.0, 1650.0
"""What sound in water is never slower, or faster, than; a negative one is DUNE's word for none."""

COLDEST_C, WARMEST_C = -2.0, 40.0
SALTIEST_PSU = 42.0
"""Where the equation of state holds; from no salt at all on."""

DEEPEST_M = 6000.0
"""No vehicle goes deeper."""

TOGETHER_S = 1.0
"""Temperature and salinity are of one water where they were measured no farther apart."""

MAX_PENDING = 256
MAX_SOURCES = 32
"""A vehicle has a few probes; entities beyond these are made up."""


@dataclass(frozen=True, slots=True)
class Water:
    """What was told of the water at a moment: the sound's speed, or temperature and salinity in its place."""

    time_s: float
    source: str
    speed_mps: float | None = None
    temperature_c: float = math.nan
    salinity_psu: float = math.nan


def sound_speed_mps(temperature_c: float, salinity_psu: float, depth_m: float, lat_deg: float) -> float:
    """Return the speed of sound in sea water by TEOS-10.

    Parameters
    ----------
    temperature_c
        In situ, ITS-90.
    salinity_psu
        Practical salinity. The small part that depends on the place's salts, under 0.05 m/s, is left out.
    depth_m
        Below the surface; with ``lat_deg`` it gives the pressure.
    """
    pressure_dbar = gsw.p_from_z(-depth_m, lat_deg)
    return float(gsw.sound_speed_t_exact(gsw.SR_from_SP(salinity_psu), temperature_c, pressure_dbar))


class WaterIntake:
    """One vehicle's reports on the water: what cannot be is dropped and counted, others await the state around them."""

    def __init__(self, vehicle: str) -> None:
        self.vehicle = vehicle
        self.accepted = 0
        self.refused = 0
        self._pending: Awaiting[Water] = Awaiting(MAX_PENDING)
        self._repeats = Repeats()
        self._sources: set[str] = set()
        self._probes: set[str] = set()
        """Those that tell the speed itself."""
        self._halves: dict[str, dict[str, tuple[float, float]]] = {}
        """By source the last temperature and salinity, each with its time."""

    def clear(self) -> None:
        """Forget what is pending, as after a jump of the vehicle's clock."""
        self._pending.clear()
        self._repeats.clear()
        self._halves.clear()

    def offer(self, name: str, source: str | None, message: Message) -> None:
        """Take a message of :data:`MESSAGES` in.

        Parameters
        ----------
        source
            The entity that sent it; None: not known yet.
        """
        source = source or ""
        time_s, value = float(message.timestamp), float(message.value)
        if not self._knows(source) or not _can_be(name, value) or self._repeats.has(f"{name} {source}", time_s):
            self.refused += 1
            return
        if name == "SoundSpeed":
            self._probes.add(source)
            self._await(Water(time_s, source, value))
        elif source not in self._probes:
            halves = self._halves.setdefault(source, {})
            halves[name] = (time_s, value)
            if len(halves) == 2 and abs(halves["Temperature"][0] - halves["Salinity"][0]) <= TOGETHER_S:
                temperature, salinity = halves["Temperature"][1], halves["Salinity"][1]
                halves.clear()
                self._await(Water(time_s, source, None, temperature, salinity))

    def resolve(self, history: StateHistory) -> Iterator[SoundSpeedSample]:
        """Yield what ``history`` can place now; what it never will is dropped."""
        for water, state in self._pending.decided(history):
            if state is None or not 0.0 <= state.depth_m <= DEEPEST_M:
                self.refused += 1
                continue
            lat_deg = math.degrees(state.lat_rad)
            speed_mps = water.speed_mps
            if speed_mps is None:
                speed_mps = sound_speed_mps(water.temperature_c, water.salinity_psu, state.depth_m, lat_deg)
            if not SLOWEST_MPS <= speed_mps <= FASTEST_MPS:
                self.refused += 1
                continue
            self.accepted += 1
            yield SoundSpeedSample(
                vehicle=self.vehicle,
                time_s=water.time_s,
                lat_deg=lat_deg,
                lon_deg=math.degrees(state.lon_rad),
                depth_m=state.depth_m,
                speed_mps=speed_mps,
                source=water.source,
            )

    def _await(self, water: Water) -> None:
        if self._pending.add(water) is not None:
            self.refused += 1

    def _knows(self, source: str) -> bool:
        if source not in self._sources and len(self._sources) < MAX_SOURCES:
            self._sources.add(source)
        return source in self._sources


def _can_be(name: str, value: float) -> bool:
    """Whether a value is within what sea water can have; one that is no number is not."""
    match name:
        case "SoundSpeed":
            return SLOWEST_MPS <= value <= FASTEST_MPS
        case "Temperature":
            return COLDEST_C <= value <= WARMEST_C
        case _:
            return 0.0 <= value <= SALTIEST_PSU
