"""What the doctor says: findings with a cause that programs can read and words that people can."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from imc_bridge.events import LinkChange, NodeState
from imc_bridge.printable import printable


class Severity(StrEnum):
    """How much a finding matters."""

    OK = "ok"
    NOTE = "note"
    PROBLEM = "problem"


class Cause(StrEnum):
    """What a finding is about; the first of a node's problems is the one to look at."""

    SOUND = "sound"
    """Nothing is wrong here."""
    SWITCHED_OFF = "switched_off"
    PORT_IN_USE = "port_in_use"
    NO_INTERFACE = "no_interface"
    NO_VEHICLE = "no_vehicle"
    NOT_HEARD = "not_heard"
    """A vehicle named in the settings is missing."""
    NO_ANNOUNCE = "no_announce"
    NO_SERVICE = "no_service"
    """Announced without an address that takes IMC."""
    ANNOUNCES_CEASED = "announces_ceased"
    NO_TRAFFIC = "no_traffic"
    """Announced, and nothing else comes."""
    UNREACHABLE = "unreachable"
    BLOCKED_PORT = "blocked_port"
    STALE_PORT = "stale_port"
    """The vehicle remembers our id at another port."""
    FOREIGN_ADDRESS = "foreign_address"
    """Its packets come from an address that it does not announce."""
    WRONG_VERSION = "wrong_version"
    SAME_ID_TWICE = "same_id_twice"
    SAME_NAME_TWICE = "same_name_twice"
    OUR_ID_TAKEN = "our_id_taken"
    CLOCK_OFF = "clock_off"
    CLOCK_RATE = "clock_rate"
    """Its clock runs faster or slower than the settings say: a simulation."""
    SILENT = "silent"
    RADIO_GAPS = "radio_gaps"
    """Radio ends under water, and the vehicle is led by references, which need it."""
    RESTARTED = "restarted"
    """DUNE on board restarted while we listened."""
    PACKETS_DROPPED = "packets_dropped"
    """This machine threw packets away because our socket was full."""
    LOW_RATE = "low_rate"
    NO_ENTITIES = "no_entities"
    NO_SOUNDINGS = "no_soundings"
    SOUNDINGS_REFUSED = "soundings_refused"
    NO_WAY_HOME = "no_way_home"
    """Nothing on board brings it home when it hears nobody, or not when it should."""
    FOREIGN_CONTROL = "foreign_control"
    NOT_READY = "not_ready"
    SEND_ERRORS = "send_errors"
    BAD_PACKETS = "bad_packets"
    REFUSED = "refused"
    """Packets from untrusted senders, or from another time."""
    UNKNOWN_MESSAGES = "unknown_messages"
    CROWDED = "crowded"
    """More systems announce themselves than there are places: some are forged."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One observation, and what to do about it when it is none to rejoice in."""

    severity: Severity
    text: str
    remedy: str = ""
    cause: Cause = Cause.SOUND


@dataclass(frozen=True, slots=True)
class NodeDiagnosis:
    """The findings on one node, and how its link changed."""

    name: str
    imc_id: int
    state: NodeState
    findings: tuple[Finding, ...]
    history: tuple[LinkChange, ...] = ()

    @property
    def healthy(self) -> bool:
        """Whether nothing keeps it from working with us."""
        return not self.causes

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Causes of its problems, the one to look at first in front."""
        return _causes(self.findings)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The findings on this machine's side (``own``) and on every node."""

    seconds: float
    own: tuple[Finding, ...]
    nodes: tuple[NodeDiagnosis, ...]

    @property
    def healthy(self) -> bool:
        """Whether at least one vehicle is there and nothing stands in any one's way."""
        return not self.causes and bool(self.nodes)

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Causes of all problems, ours first."""
        return _causes([*self.own, *(finding for node in self.nodes for finding in node.findings)])

    def text(self) -> str:
        """The whole as plain lines for a terminal."""
        lines = [f"Listened for {self.seconds:g} s."]
        lines += [_line(finding) for finding in self.own]
        for node in self.nodes:
            lines.append(f"{node.name} (0x{node.imc_id:04X}): {node.state.value}")
            lines += [f"  {_line(finding)}" for finding in node.findings]
        return "\n".join(map(printable, lines))


def radio_gap_words(gaps: int) -> tuple[str, str]:
    """The finding for a vehicle that is led by references where radio does not reach, with its remedy."""
    times = "once" if gaps == 1 else f"{gaps} times"
    return (
        f"radio ended {times} while it was under water and led by references, which ends its plan on board each time",
        "Take it out of the mission and add it again with guidance 'legs', which needs no radio under water; "
        "what it measures there is in its own log (import-log)",
    )


def restart_words(restarts: int) -> tuple[str, str]:
    """The finding for a vehicle whose DUNE restarted, with its remedy."""
    times = "once" if restarts == 1 else f"{restarts} times"
    return (
        f"DUNE on board has restarted {times} since we listen; what it was doing is forgotten each time",
        "Look into its own log for the reason before it goes under water again: while DUNE is away the vehicle drifts",
    )


def drop_words(count: int, buffer_bytes: int) -> tuple[str, str]:
    """The finding for packets that this machine dropped, with its remedy."""
    return (
        f"this machine threw {count} packets away because it did not read its IMC socket in time "
        f"(room for {buffer_bytes / 1e6:.1f} MB); what is missing of vehicles may be among them",
        "Let vehicles send less (imc.rate_limiters, empty leaves 700 packets a second each), give the machine less to "
        "do or time_scale a lower value, or allow a larger buffer (sysctl net.core.rmem_max)",
    )


def ok(text: str) -> Finding:
    """All is well with this."""
    return Finding(Severity.OK, text)


def note(cause: Cause, text: str, remedy: str = "") -> Finding:
    """Worth knowing, but harmless."""
    return Finding(Severity.NOTE, text, remedy, cause)


def problem(cause: Cause, text: str, remedy: str) -> Finding:
    """Something that keeps a vehicle from working with us."""
    return Finding(Severity.PROBLEM, text, remedy, cause)


def _causes(findings: list[Finding] | tuple[Finding, ...]) -> tuple[Cause, ...]:
    return tuple(dict.fromkeys(finding.cause for finding in findings if finding.severity is Severity.PROBLEM))


def _line(finding: Finding) -> str:
    remedy = f" -> {finding.remedy}" if finding.remedy else ""
    return f"[{finding.severity.value}] {finding.text}{remedy}"
