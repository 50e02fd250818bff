"""Entities of a simulated LAUV: the table that a DUNE node reports, with the ids of the real one."""

from __future__ import annotations

from simulator.sonars.sensors import SensorKind
from simulator.world import SimulatedVehicle

# fmt: off
_NAMES = (
    "Daemon", "Text Message Parser", "Allocator", "Attitude", "Roll Parcel", "Pitch Parcel",
    "Depth Parcel", "Altitude Parcel", "Heading Parcel", "Heading Rate Parcel", "Coarse Altitude",
    "Remote Control", "Speed Control", "Path Control", "Path Control - Bottom Track",
    "Communications Relay Maneuver", "Compass Calibration Maneuver", "Follow Reference Maneuver",
    "Multiplexer Maneuver", "Idle Maneuver", "Goto Maneuver", "Launch Maneuver", "Loiter Maneuver",
    "Station Keeping Maneuver", "YoYo Maneuver", "Rows Maneuver", "Follow Path Maneuver",
    "Elevator Maneuver", "Pop Up Maneuver", "Dislodge Maneuver", "ScheduledGoto Maneuver",
    "Takeoff Maneuver", "Land Maneuver", "Drop Maneuver", "Sample Maneuver",
    "StationKeepingExtended Maneuver", "Teleoperation Maneuver", "Entity Monitor", "Host Resources",
    "CPU1", "CPU2", "DUNE-CPU", "DUNE-RAM", "DUNE-SWAP", "Medium", "Operational Limits",
    "Servo Monitor", "State Reporter", "CPU Uptime", "Navigation", "Plan Database", "Plan Engine",
    "Plan Generator", "Acoustic Modem", "CTD", "DVL", "Depth Sensor", "Environment", "Altimeter",
    "Echo Sounder", "GPS", "Sound Speed Simulator", "CTD Simulator", "AHRS", "LBL", "Leak Simulator",
    "Leak Sensor - Tail", "Leak Sensor - Nose", "Motor", "Servos", "Stream Velocity Simulator",
    "Simulation Engine", "Vehicle Supervisor", "Service Announcer", "Cache", "Communications Manager",
    "Service Discovery", "Message Fragments", "Log Book", "Logger", "UDP",
)
# fmt: on

SIMULATION = {name: number for number, name in enumerate(_NAMES)}
"""Entities of DUNE's own simulation of a LAUV."""

HARDWARE_DVL = {name: len(_NAMES) + k for k, name in enumerate([f"DVL Beam {n}" for n in range(4)])}
"""What real vehicles with a DVL have in addition."""

HARDWARE_MULTIBEAM = {"Multibeam": len(_NAMES) + len(HARDWARE_DVL)}
"""What vehicles with a multibeam sonar have in addition."""

HARDWARE_FUEL = {"Fuel": len(_NAMES) + len(HARDWARE_DVL) + len(HARDWARE_MULTIBEAM)}
"""What real vehicles estimate their energy with; DUNE's own simulation has no battery."""

SUPERVISORS = {"Lost Comms": len(_NAMES) + len(HARDWARE_DVL) + len(HARDWARE_MULTIBEAM) + len(HARDWARE_FUEL)}
"""What runs only where a vehicle's configuration enables it."""

ANY = 255
"""No particular entity."""


def entity_list(extra: dict[str, int]) -> str:
    """The ``list`` field of an EntityList report: ``name=id`` pairs joined by semicolons."""
    return ";".join(f"{name}={number}" for name, number in (SIMULATION | extra).items())


def equipment_of(vehicle: SimulatedVehicle) -> dict[str, int]:
    """Ids by name of what a vehicle has beyond DUNE's own simulation."""
    sonars = {SensorKind.DVL: HARDWARE_DVL, SensorKind.MULTIBEAM: HARDWARE_MULTIBEAM}
    return sonars.get(vehicle.sonar.kind, {}) | ({} if vehicle.battery is None else HARDWARE_FUEL)
