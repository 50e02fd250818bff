"""The one table of alarms: what there is to be raised, how grave it is, and what the person on watch does about it."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class AlarmSeverity(StrEnum):
    """How grave an alarm is, least to most, in the words of ITU-T X.733."""

    MINOR = "minor"
    """The survey suffers; nobody is in danger."""
    MAJOR = "major"
    """A vehicle, or the mission, goes on without what it needs."""
    CRITICAL = "critical"
    """A vehicle may be lost, or be where it must not be, unless somebody acts."""

    def at_least(self, other: "AlarmSeverity") -> bool:
        """Whether this is as grave as the other one, or more."""
        order = list(AlarmSeverity)
        return order.index(self) >= order.index(other)


class AlarmKind(StrEnum):
    """What is raised as an alarm. Those of failsafes have the failsafes' names."""

    LEAK = "leak"
    CRITICAL_ENERGY = "critical_energy"
    TOO_DEEP = "too_deep"
    POSITION_LOST = "position_lost"
    NO_POSITION = "no_position"
    LOW_ENERGY = "low_energy"
    LINK_LOST = "link_lost"
    TRAFFIC = "traffic"
    GEOFENCE_LEFT = "geofence_left"
    VEHICLE_ERROR = "vehicle_error"
    OTHER_CONSOLE = "other_console"
    ALL_LINKS_LOST = "all_links_lost"
    ZONE_ENTERED = "zone_entered"
    AREA_LEFT = "area_left"
    VEHICLE_LOST = "vehicle_lost"
    VEHICLE_RESTARTED = "vehicle_restarted"
    VEHICLE_REFUSES = "vehicle_refuses"
    STOP_NOT_ACKNOWLEDGED = "stop_not_acknowledged"
    NOT_COME_HOME = "not_come_home"
    NO_WAY_HOME = "no_way_home"
    NO_VEHICLE = "no_vehicle"
    NO_WAYPOINT = "no_waypoint"
    NO_SCAN = "no_scan"
    SEARCH_LATE = "search_late"
    SEARCH_STUCK = "search_stuck"
    NO_WATER_LEVEL = "no_water_level"
    DATABASE_UNWRITABLE = "database_unwritable"
    MISSION_FAILED = "mission_failed"
    NOT_BEGUN = "not_begun"
    WATCH_FAILED = "watch_failed"
    TEST = "test"


@dataclass(frozen=True, slots=True)
class AlarmRule:
    """One line of the table.

    Attributes
    ----------
    severity
        How grave it is.
    raised
        When it is raised.
    action
        What whoever is on watch does.
    event
        The kind of its line in the mission's log.
    """

    severity: AlarmSeverity
    raised: str
    action: str
    event: str = "failsafe"


_MINOR, _MAJOR, _CRITICAL = AlarmSeverity

ALARMS: Mapping[AlarmKind, AlarmRule] = {
    AlarmKind.LEAK: AlarmRule(_CRITICAL, "a vehicle reports water inside", "recover it where it comes up"),
    AlarmKind.CRITICAL_ENERGY: AlarmRule(
        _CRITICAL, "what a vehicle has left does not last for its way home", "recover it where it comes up"
    ),
    AlarmKind.TOO_DEEP: AlarmRule(
        _CRITICAL, "a vehicle is deeper, or closer to the bottom, than it may", "watch it rise; abort it if it does not"
    ),
    AlarmKind.POSITION_LOST: AlarmRule(
        _CRITICAL, "a vehicle does not know where it is", "look for it where it comes up"
    ),
    AlarmKind.NO_POSITION: AlarmRule(
        _CRITICAL,
        "a vehicle is heard and does not tell where it is",
        "look for it where it was last; see its navigation",
    ),
    AlarmKind.LOW_ENERGY: AlarmRule(_MAJOR, "a vehicle turns back for its energy", "be at the recovery point in time"),
    AlarmKind.LINK_LOST: AlarmRule(_CRITICAL, "a vehicle was silent for too long", "look for it along its way home"),
    AlarmKind.TRAFFIC: AlarmRule(
        _CRITICAL, "a ship comes close to a vehicle at the surface", "call the ship; hold the vehicle below"
    ),
    AlarmKind.GEOFENCE_LEFT: AlarmRule(
        _CRITICAL, "a vehicle stays in a keep-out zone or outside the area", "abort it, or recover it"
    ),
    AlarmKind.VEHICLE_ERROR: AlarmRule(_MAJOR, "a vehicle reports an error", "read its words, and its own log"),
    AlarmKind.OTHER_CONSOLE: AlarmRule(_MAJOR, "a vehicle that followed now follows somebody else", "ask who has it"),
    AlarmKind.ALL_LINKS_LOST: AlarmRule(
        _CRITICAL, "no vehicle of a mission is heard any more", "see to radio, antenna and network"
    ),
    AlarmKind.ZONE_ENTERED: AlarmRule(
        _CRITICAL, "a vehicle reports a position in a keep-out zone", "abort it if it goes on", "boundary"
    ),
    AlarmKind.AREA_LEFT: AlarmRule(
        _MAJOR, "a vehicle reports a position far outside the area", "abort it if it goes on", "boundary"
    ),
    AlarmKind.VEHICLE_LOST: AlarmRule(
        _MAJOR, "a vehicle that followed is silent", "wait for it to be heard again; see its last position", "vehicle"
    ),
    AlarmKind.VEHICLE_RESTARTED: AlarmRule(
        _MAJOR, "the program on board of a vehicle restarted", "look why; it is engaged again", "vehicle"
    ),
    AlarmKind.VEHICLE_REFUSES: AlarmRule(
        _MAJOR, "a vehicle that followed refuses to", "read its reason; take it out, or pause and resume", "vehicle"
    ),
    AlarmKind.STOP_NOT_ACKNOWLEDGED: AlarmRule(
        _CRITICAL, "a vehicle did not acknowledge that it is stopped", "stop it from its own console", "stop"
    ),
    AlarmKind.NOT_COME_HOME: AlarmRule(
        _CRITICAL, "a vehicle did not come home and cannot be reached", "look for it along its way home", "recovery"
    ),
    AlarmKind.NO_WAY_HOME: AlarmRule(
        _CRITICAL, "no way leads a vehicle home that keeps clear of zones", "recover it where it comes up", "recovery"
    ),
    AlarmKind.NO_VEHICLE: AlarmRule(
        _MAJOR,
        "no vehicle of a mission can be sent anywhere",
        "bring one into contact, resume one that is home, or add one",
        "waiting",
    ),
    AlarmKind.NO_WAYPOINT: AlarmRule(
        _MAJOR, "no vehicle may go anywhere", "read why; change limits or zones in a new mission", "waiting"
    ),
    AlarmKind.NO_SCAN: AlarmRule(_MINOR, "a search waits for a scan in vain", "look at the scanner", "waiting"),
    AlarmKind.SEARCH_LATE: AlarmRule(
        _MAJOR, "a search's time is up and not everybody is back", "see that they come back", "late"
    ),
    AlarmKind.SEARCH_STUCK: AlarmRule(
        _MAJOR, "no vehicle of a search finds a way on or back", "bring them back by hand", "stuck"
    ),
    AlarmKind.NO_WATER_LEVEL: AlarmRule(
        _MINOR, "soundings are rejected for want of a water level", "send a tide table that covers them", "corrections"
    ),
    AlarmKind.DATABASE_UNWRITABLE: AlarmRule(
        _MAJOR, "nothing can be written into the database", "free space on the disk, or see to the server", "storage"
    ),
    AlarmKind.MISSION_FAILED: AlarmRule(
        _CRITICAL,
        "a mission ended by an error; its vehicles are stopped",
        "recover them; report the error",
        "state",
    ),
    AlarmKind.NOT_BEGUN: AlarmRule(
        _MAJOR,
        "a mission that follows another one does not begin by itself",
        "read why; start it, or bring its vehicles in",
        "waiting",
    ),
    AlarmKind.WATCH_FAILED: AlarmRule(
        _CRITICAL,
        "something that looks after a mission's vehicles fails, such as failsafes or keeping them apart",
        "watch the vehicles yourself; read why, pause or call them home, restart the service; report the error",
        "safety",
    ),
    AlarmKind.TEST: AlarmRule(_MINOR, "somebody tries who is told", "nothing", "test"),
}
"""Every alarm there is."""

OF_A_MISSION = (
    AlarmKind.NO_VEHICLE,
    AlarmKind.NO_WAYPOINT,
    AlarmKind.NO_SCAN,
    AlarmKind.SEARCH_LATE,
    AlarmKind.SEARCH_STUCK,
    AlarmKind.NO_WATER_LEVEL,
    AlarmKind.WATCH_FAILED,
)
"""Those that are over when their mission is: they say that it does not go on as it should."""


def alarms_text() -> str:
    """Return the table as Markdown."""
    lines = ["| alarm | severity | raised when | what to do |", "| --- | --- | --- | --- |"]
    lines += [f"| `{kind}` | {rule.severity} | {rule.raised} | {rule.action} |" for kind, rule in ALARMS.items()]
    return "\n".join(lines) + "\n"
