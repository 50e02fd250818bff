"""What keeps a vehicle from working with us: listens for a while, then says for every node what is missing."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from enum import StrEnum

from imc_bridge.bridge import Bridge
from imc_bridge.codec import PacketFault
from imc_bridge.events import NodeState, NodeView
from imc_bridge.settings import BridgeSettings

OUR_IMC_VERSION = "5.4.30"
CLOCK_TOLERANCE_S = 5.0
MIN_STATE_RATE_HZ = 1.0
SILENT_HEARTBEAT_S = 5.0


class Severity(StrEnum):
    """How much a finding matters."""

    OK = "ok"
    NOTE = "note"
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class Finding:
    """One observation, and what to do about it when it is none to rejoice in."""

    severity: Severity
    text: str
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class NodeDiagnosis:
    """The findings on one node."""

    name: str
    imc_id: int
    state: NodeState
    findings: tuple[Finding, ...]

    @property
    def healthy(self) -> bool:
        """Whether nothing keeps it from working with us."""
        return all(finding.severity is not Severity.PROBLEM for finding in self.findings)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The findings on this machine's side (``own``) and on every node."""

    seconds: float
    own: tuple[Finding, ...]
    nodes: tuple[NodeDiagnosis, ...]

    @property
    def healthy(self) -> bool:
        """Whether at least one vehicle is there and nothing stands in any one's way."""
        own = all(finding.severity is not Severity.PROBLEM for finding in self.own)
        return own and bool(self.nodes) and all(node.healthy for node in self.nodes)

    def text(self) -> str:
        """The whole as plain lines for a terminal."""
        lines = [f"Listened for {self.seconds:g} s."]
        lines += [_line(finding) for finding in self.own]
        for node in self.nodes:
            lines.append(f"{node.name} (0x{node.imc_id:04X}): {node.state.value}")
            lines += [f"  {_line(finding)}" for finding in node.findings]
        return "\n".join(lines)


def _line(finding: Finding) -> str:
    remedy = f" -> {finding.remedy}" if finding.remedy else ""
    return f"[{finding.severity.value}] {finding.text}{remedy}"


async def diagnose(settings: BridgeSettings, seconds: float = 15.0) -> Diagnosis:
    """Listen with our own id and port, without commanding anything, and judge what was heard.

    Parameters
    ----------
    settings
        Those of the service, which must not be running: id and port are the same.
    seconds
        Wall time to listen. Announces come every 10 s and telemetry up to 5 s later.

    Raises
    ------
    imc_bridge.transport.PortInUseError
        When the service or another console holds the port.
    """
    bridge = Bridge(settings, commanding=False)
    await bridge.start(lambda _event: None)
    try:
        await asyncio.sleep(seconds)
        return judge(bridge, seconds)
    finally:
        await bridge.close()


def judge(bridge: Bridge, seconds: float) -> Diagnosis:
    """The diagnosis of a running bridge, which has listened for ``seconds``."""
    vehicles = [node for node in bridge.nodes() if node.is_vehicle]
    wanted = bridge.settings.vehicles
    nodes = tuple(
        NodeDiagnosis(node.name, node.imc_id, node.state, tuple(_node_findings(node, bridge)))
        for node in vehicles
        if not wanted or node.name in wanted or node.state is NodeState.HEARD
    )
    missing = [name for name in wanted if name not in {node.name for node in vehicles}]
    return Diagnosis(seconds, tuple(_own_findings(bridge, nodes, missing)), nodes)


def _own_findings(bridge: Bridge, nodes: tuple[NodeDiagnosis, ...], missing: list[str]) -> list[Finding]:
    settings, transport = bridge.settings, bridge.transport
    where = "loopback only" if settings.loopback_only else ", ".join(transport.own_addresses())
    findings = [
        Finding(
            Severity.OK,
            f"id 0x{settings.imc_id:04X}, traffic on UDP {settings.port}, announces heard on UDP "
            f"{transport.announce_port}, interfaces: {where}",
        )
    ]
    if not settings.loopback_only and not transport.interfaces:
        findings.append(
            Finding(
                Severity.PROBLEM,
                "this machine has no network interface besides loopback",
                "Connect it to the vehicles' network",
            )
        )
    if not nodes:
        findings.append(
            Finding(
                Severity.PROBLEM,
                "no vehicle was heard: no announce, no packet",
                "Check that DUNE runs, that it is on the same network (multicast "
                f"{settings.multicast_group} or broadcast must pass), and that no firewall blocks UDP "
                f"{settings.announce_ports[0]}-{settings.announce_ports[-1]} and {settings.port}",
            )
        )
    findings += [
        Finding(Severity.PROBLEM, f"{name} was not heard", "Check its name, power and network") for name in missing
    ]
    for reason, count in transport.send_errors.items():
        findings.append(
            Finding(Severity.PROBLEM, f"{count} packets could not be sent: {reason}", "Check routes and interfaces")
        )
    faults = bridge.decoder.faults + bridge.announces.faults
    for fault in (PacketFault.SYNC, PacketFault.LENGTH, PacketFault.CHECKSUM):
        if faults[fault]:
            findings.append(
                Finding(
                    Severity.NOTE,
                    f"{faults[fault]} packets dropped: {fault.value}",
                    "Another program sends to our ports, or a sender's IMC definitions differ from ours",
                )
            )
    if faults[PacketFault.UNKNOWN]:
        ids = ", ".join(map(str, sorted(bridge.decoder.unknown_ids)[:8]))
        findings.append(Finding(Severity.NOTE, f"{faults[PacketFault.UNKNOWN]} packets of unknown ids skipped: {ids}"))
    return findings


def _node_findings(node: NodeView, bridge: Bridge) -> list[Finding]:
    settings = bridge.settings
    scale = settings.time_scale
    findings = [_announce_finding(node, settings)]
    if node.conflict:
        findings.append(Finding(Severity.PROBLEM, node.conflict, "Two systems with one id cannot be told apart"))
    if node.state is NodeState.HEARD:
        return findings
    if node.imc_version is not None:
        findings.append(_version_finding(node.imc_version))
    if node.age_s is None:
        findings.append(
            Finding(
                Severity.PROBLEM if node.state is NodeState.ANNOUNCED else Severity.NOTE,
                f"no packet from {node.address}",
                node.reason or f"Allow UDP {settings.port} through the firewall, or listen for longer",
            )
        )
        return findings
    if node.age_s * scale > SILENT_HEARTBEAT_S:
        findings.append(Finding(Severity.PROBLEM, f"last packet {node.age_s:.0f} s ago", node.reason))
    state_rate = node.rates_hz.get("EstimatedState", 0.0)
    findings.append(
        Finding(Severity.OK, f"EstimatedState at {state_rate:.1f} Hz from {node.address}")
        if state_rate >= MIN_STATE_RATE_HZ
        else Finding(
            Severity.PROBLEM,
            f"EstimatedState at {state_rate:.1f} Hz",
            "Check that navigation runs on board and that the link is not saturated",
        )
    )
    findings += _sounding_findings(node)
    if node.clock_offset_s is not None and abs(node.clock_offset_s) > CLOCK_TOLERANCE_S and scale == 1.0:
        side = "ahead of" if node.clock_offset_s > 0 else "behind"
        findings.append(
            Finding(
                Severity.NOTE,
                f"its clock is {abs(node.clock_offset_s):.0f} s {side} ours",
                "Synchronise both by NTP or GPS, or times in products will disagree",
            )
        )
    if node.state is NodeState.READY:
        findings.append(Finding(Severity.OK, "in service and ready for a plan"))
    elif node.state is not NodeState.LOST:
        findings.append(Finding(Severity.NOTE, node.reason or node.state.value, _remedy_of(node)))
    return findings


def _announce_finding(node: NodeView, settings: BridgeSettings) -> Finding:
    if node.announce_age_s is None:
        return Finding(Severity.PROBLEM, f"{node.foreign_address} packets, but no announce", node.reason)
    if node.address is None:
        return Finding(Severity.PROBLEM, "announced without an imc+udp address", node.reason)
    late = node.announce_age_s * settings.time_scale > 3.0 * settings.announce_period_s
    return Finding(
        Severity.PROBLEM if late else Severity.OK,
        f"announced {node.announce_age_s:.0f} s ago as reachable at {node.address}",
        "Its announces have ceased: check its network" if late else "",
    )


def _version_finding(version: str) -> Finding:
    if version.split(".")[:2] == OUR_IMC_VERSION.split(".")[:2]:
        return Finding(Severity.OK, f"IMC {version} (ours {OUR_IMC_VERSION})")
    return Finding(
        Severity.PROBLEM,
        f"IMC {version} where we speak {OUR_IMC_VERSION}",
        "Messages may differ in layout: use DUNE of the same IMC minor version",
    )


def _sounding_findings(node: NodeView) -> list[Finding]:
    if node.entities is None:
        return [Finding(Severity.PROBLEM, "entity names unknown", "It does not answer EntityList: does it hear us?")]
    findings = [
        Finding(Severity.OK, f"bottom measured by {', '.join(node.bottom_sensors)}")
        if node.bottom_sensors
        else Finding(
            Severity.PROBLEM,
            "no Distance from a bottom-looking sensor",
            "Switch on the altimeter or DVL (entities Altimeter, DVL Filtered, DVL Beam 0..3)",
        )
    ]
    findings += [
        Finding(Severity.NOTE, f"{count} Distances refused: {reason}") for reason, count in sorted(node.refused.items())
    ]
    return findings


def _remedy_of(node: NodeView) -> str:
    if node.state is NodeState.IN_PLAN and not node.ours:
        return "Stop that plan on its console before a mission"
    if node.state is NodeState.ACTIVE:
        return "Clear what the vehicle reports before a mission"
    return ""
