"""What keeps a vehicle from working with us: listens for a while, then says for every node what is missing."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping

from imc_bridge.bridge import Bridge
from imc_bridge.control.way_home import NOT_ON_BOARD
from imc_bridge.doctor.diagnosis import (
    Cause,
    Diagnosis,
    Finding,
    NodeDiagnosis,
    Severity,
    drop_words,
    note,
    ok,
    problem,
    radio_gap_words,
    restart_words,
)
from imc_bridge.doctor.ports import holder_of_udp_port
from imc_bridge.doctor.probe import Answer, probe
from imc_bridge.doctor.replay import replay
from imc_bridge.events import NodeState, NodeView
from imc_bridge.network.codec import PacketFault
from imc_bridge.network.transport import PortInUseError
from imc_bridge.nodes.lost_comms import DEFAULT_PLAN_NAME, DUNE_CONSOLE_IDS
from imc_bridge.nodes.refusals import Refused
from imc_bridge.settings import BridgeSettings

__all__ = ["Cause", "Diagnosis", "Finding", "NodeDiagnosis", "Severity", "diagnose", "diagnose_recording", "judge"]

OUR_IMC_VERSION = "5.4.30"
CLOCK_TOLERANCE_S = 5.0
CLOCK_WRONG_S = 60.0
"""Tides and times in products are wrong by then."""
SLOWEST_RATE, FASTEST_RATE = 0.5, 1.5
"""Relative to what is expected; a simulation that merely cannot keep up lies between."""
MIN_STATE_RATE_HZ = 1.0
SILENT_HEARTBEAT_S = 5.0
CROWD_GONE_S = 60.0
"""Wall clock: this long after the last one, made-up systems are not reported any more."""
REFUSED_REMEDY = "Somebody may pretend to be a vehicle, or settings that begin with allowed_ leave one out"
FLOOD_REMEDY = (
    "Where that address is a vehicle of yours it sends more than is allowed for: let it send less (imc.rate_limiters), "
    "or raise imc.max_packets_per_s, which is multiplied by time_scale. Otherwise keep it out by imc.allowed_addresses"
)


async def diagnose(settings: BridgeSettings, seconds: float = 15.0) -> Diagnosis:
    """Listen with our own id and port, without commanding anything, and judge what arrived.

    Vehicles that announce themselves and send nothing are asked again in ways that show why (some 8 s more).

    Parameters
    ----------
    settings
        Those of the service, which must not be running: id and port are the same.
    seconds
        Wall time to listen. Announces come every 10 s and telemetry up to 5 s later.
    """
    bridge = Bridge(settings, commanding=False)
    try:
        await bridge.start(lambda _event: None)
    except PortInUseError as error:
        return Diagnosis(0.0, (_port_in_use(error, settings),), ())
    try:
        await asyncio.sleep(seconds)
        # What is judged is the state before the probe, whose answers would hide what is wrong.
        views = bridge.nodes()
        return judge(bridge, seconds, views=views, answers=await probe(bridge))
    finally:
        await bridge.close()


def diagnose_recording(path: str, settings: BridgeSettings) -> Diagnosis:
    """Judge a recorded session as if we had been its console.

    Raises
    ------
    imc_bridge.doctor.replay.RecordingError
        When the file is none; the message says what would be.
    """
    session = replay(path, settings)
    return judge(session.bridge, session.seconds, live=False)


def judge(
    bridge: Bridge,
    seconds: float,
    *,
    views: tuple[NodeView, ...] | None = None,
    answers: Mapping[int, Answer] | None = None,
    live: bool = True,
) -> Diagnosis:
    """The diagnosis of a bridge that has listened for ``seconds``.

    Parameters
    ----------
    bridge
    seconds
    views
        The nodes as they were when judged; now, by default.
    answers
        How silent vehicles answered to :func:`imc_bridge.doctor.probe.probe`.
    live
        False for a replay, which has no sockets.
    """
    vehicles = [node for node in (bridge.nodes() if views is None else views) if node.is_vehicle]
    wanted = bridge.settings.vehicles
    nodes = tuple(
        NodeDiagnosis(
            name=node.name,
            imc_id=node.imc_id,
            state=node.state,
            findings=tuple(_node_findings(node, bridge, answers or {}, live=live)),
            history=node.history,
        )
        for node in vehicles
        if not wanted or node.name in wanted or node.state is NodeState.HEARD
    )
    missing = [name for name in wanted if name not in {node.name for node in vehicles}]
    own = _socket_findings(bridge, heard=any(node.age_s is not None for node in vehicles)) if live else []
    return Diagnosis(seconds, (*own, *_network_findings(bridge, nodes, missing)), nodes)


def _port_in_use(error: PortInUseError, settings: BridgeSettings) -> Finding:
    holder = holder_of_udp_port(settings.port)
    return problem(
        Cause.PORT_IN_USE,
        f"{error}" + (f"; UDP port {settings.port} is held by {holder}" if holder else ""),
        "If that is bathyfleet itself, ask it: GET /api/v1/doctor; otherwise stop that program",
    )


def _socket_findings(bridge: Bridge, *, heard: bool) -> list[Finding]:
    settings, transport = bridge.settings, bridge.transport
    where = "loopback only" if settings.loopback_only else ", ".join(transport.own_addresses())
    findings = [
        ok(
            f"id 0x{settings.id:04X}, traffic on UDP {settings.port}, announces heard on UDP "
            f"{transport.announce_port}, interfaces: {where}"
        )
    ]
    if not settings.loopback_only and not transport.interfaces:
        alone = "this machine has no network interface besides loopback"
        findings.append(
            # Vehicles on this machine need none.
            note(Cause.NO_INTERFACE, f"{alone}; vehicles on this machine are heard")
            if heard
            else problem(Cause.NO_INTERFACE, alone, "Connect it to the vehicles' network")
        )
    drops = bridge.drops
    if drops.total:
        say = problem if drops.recent else note
        findings.append(say(Cause.PACKETS_DROPPED, *drop_words(drops.total, transport.receive_buffer_bytes)))
    for reason, count in transport.send_errors.items():
        findings.append(
            problem(
                Cause.SEND_ERRORS, f"{count} packets could not be sent: {reason}", "Check routes and the local firewall"
            )
        )
    return findings


def _network_findings(bridge: Bridge, nodes: tuple[NodeDiagnosis, ...], missing: list[str]) -> list[Finding]:
    settings = bridge.settings
    findings = []
    if bridge.double:
        findings.append(
            problem(
                Cause.OUR_ID_TAKEN,
                f"our id 0x{settings.id:04X} is announced by {bridge.double}, too",
                "Vehicles talk to whom they heard first: give one of the two another IMC id",
            )
        )
    if not nodes:
        findings.append(
            problem(
                Cause.NO_VEHICLE,
                "no vehicle was heard: no announce, no packet",
                "Check that DUNE runs, that it is on the same network (multicast "
                f"{settings.multicast_group} or broadcast must pass), and that no firewall blocks UDP "
                f"{settings.announce_ports[0]}-{settings.announce_ports[-1]} and {settings.port}",
            )
        )
    findings += [
        problem(Cause.NOT_HEARD, f"{name} was not heard", "Check its name, its power and its network")
        for name in missing
    ]
    return findings + _packet_findings(bridge)


def _packet_findings(bridge: Bridge) -> list[Finding]:
    findings = []
    faults = bridge.decoder.faults + bridge.announces.faults
    versions = bridge.decoder.foreign_versions + bridge.announces.foreign_versions
    for (host, version), count in versions.most_common():
        findings.append(
            problem(
                Cause.WRONG_VERSION,
                f"{count} packets from {host} are of IMC {version}, where we speak {OUR_IMC_VERSION}",
                "Nothing of it can be read: use DUNE of the same IMC minor version",
            )
        )
    findings += _crowd_findings(bridge)
    findings += [
        note(
            Cause.REFUSED,
            f"{count} packets were not taken in: {reason}; the last one came from {bridge.admission.last[reason]}",
            FLOOD_REMEDY if reason is Refused.FLOOD else REFUSED_REMEDY,
        )
        for reason, count in bridge.admission.refused.most_common()
        if reason is not Refused.CROWDED
    ]
    findings += [
        note(
            Cause.BAD_PACKETS,
            f"{faults[fault]} packets dropped: {fault.value}",
            "Another program sends to our ports, or a sender's IMC definitions differ from ours",
        )
        for fault in (PacketFault.SYNC, PacketFault.LENGTH, PacketFault.CHECKSUM)
        if faults[fault] > (versions.total() if fault is PacketFault.SYNC else 0)
    ]
    if faults[PacketFault.UNKNOWN]:
        ids = ", ".join(map(str, sorted(bridge.decoder.unknown_ids)[:8]))
        text = f"{faults[PacketFault.UNKNOWN]} packets of unknown ids skipped: {ids}"
        findings.append(note(Cause.UNKNOWN_MESSAGES, text))
    return findings


def _crowd_findings(bridge: Bridge) -> list[Finding]:
    """Whether more systems claim to be there than are kept; a problem while that goes on."""
    admission = bridge.admission
    count = admission.refused[Refused.CROWDED]
    if not count:
        return []
    text = f"{count} packets were not taken in: {Refused.CROWDED}; the last one from {admission.last[Refused.CROWDED]}"
    if admission.age_s(Refused.CROWDED) > CROWD_GONE_S:
        return [note(Cause.CROWDED, text)]
    remedy = (
        "Somebody makes systems up: find who sends from there. Vehicles of missions and those that are heard keep "
        "their places; with imc.allowed_ids or imc.allowed_addresses nobody else gets one"
    )
    return [problem(Cause.CROWDED, text, remedy)]


def _node_findings(node: NodeView, bridge: Bridge, answers: Mapping[int, Answer], *, live: bool) -> list[Finding]:
    settings = bridge.settings
    findings = [_announce_finding(node, settings)]
    if node.conflict:
        findings.append(
            problem(Cause.SAME_ID_TWICE, node.conflict, "Two systems with one id cannot be told apart, so none is used")
            if not node.namesake
            else problem(
                Cause.SAME_NAME_TWICE, node.conflict, "A mission names its vehicles, so neither is used by this name"
            )
        )
        # Whatever else is seen of them is a mixture.
        return findings
    if node.state is NodeState.HEARD:
        return findings
    if node.imc_version is not None:
        findings.append(_version_finding(node.imc_version))
    if node.age_s is None:
        return [*findings, _silence_finding(node, bridge, answers.get(node.imc_id))]
    if node.age_s * settings.time_scale > SILENT_HEARTBEAT_S:
        findings.append(problem(Cause.SILENT, f"last packet {node.age_s:.0f} s ago", node.reason))
    findings += _state_findings(node, bridge.drops.recent)
    if node.restarts:
        findings.append(note(Cause.RESTARTED, *restart_words(node.restarts)))
    if node.radio_gaps:
        findings.append(problem(Cause.RADIO_GAPS, *radio_gap_words(node.radio_gaps)))
    findings += _sounding_findings(node, live=live)
    findings += _clock_findings(node, settings)
    findings += _way_home_findings(node, settings)
    findings += _plan_findings(node, settings)
    return findings


def _announce_finding(node: NodeView, settings: BridgeSettings) -> Finding:
    if node.announce_age_s is None:
        source = f" from {node.foreign_from}" if node.foreign_from else ""
        return problem(
            Cause.NO_ANNOUNCE,
            f"{node.foreign_address} packets{source}, but no announce",
            f"{node.reason}; without it nothing of it counts. A switch or access point that drops multicast and "
            "broadcast, or a firewall on those ports, has this effect",
        )
    if not node.addresses:
        return problem(Cause.NO_SERVICE, "announced without an imc+udp address", node.reason)
    if node.announce_age_s * settings.time_scale > 3.0 * settings.announce_period_s:
        return problem(
            Cause.ANNOUNCES_CEASED,
            f"announced {node.announce_age_s:.0f} s ago, and not since",
            "Its announces have ceased: check that DUNE runs, and its network",
        )
    return ok(f"announced {node.announce_age_s:.0f} s ago as reachable at {node.address}")


def _version_finding(version: str) -> Finding:
    if version.split(".")[:2] == OUR_IMC_VERSION.split(".")[:2]:
        return ok(f"IMC {version} (ours {OUR_IMC_VERSION})")
    return problem(
        Cause.WRONG_VERSION,
        f"IMC {version} where we speak {OUR_IMC_VERSION}",
        "Messages may differ in layout: use DUNE of the same IMC minor version",
    )


def _silence_finding(node: NodeView, bridge: Bridge, answer: Answer | None) -> Finding:
    """Why an announced vehicle sends us nothing."""
    settings, transport = bridge.settings, bridge.transport
    if node.foreign_address:
        return problem(
            Cause.FOREIGN_ADDRESS,
            f"its packets come from {node.foreign_from}, but it announces {_addresses(node)}",
            "A router or a second interface changes its address: packets count only from an announced one",
        )
    if answer is Answer.TO_FRESH_ID:
        return problem(
            Cause.STALE_PORT,
            f"it answers on UDP {settings.port} to a fresh id, but not to ours: "
            f"it remembers id 0x{settings.id:04X} at another port",
            f"Go back to the port used before, or give this service another IMC id, or restart DUNE on {node.name}",
        )
    if answer is Answer.ON_OTHER_PORT:
        return problem(
            Cause.BLOCKED_PORT,
            f"it answers on another port of this machine, but nothing arrives on UDP {settings.port}",
            f"A firewall blocks that port: allow UDP {settings.port} (e.g. `ufw allow {settings.port}/udp`)",
        )
    failed = {address: transport.unreachable[address] for address in node.addresses if address in transport.unreachable}
    failed |= {a: text for a, text in transport.streams.errors.items() if a in node.addresses}
    if failed and len(failed) == len(node.addresses):
        where = "; ".join(f"{host}:{port}: {text}" for (host, port), text in failed.items())
        return problem(
            Cause.UNREACHABLE,
            f"announced, but what we send does not arrive ({where})",
            "Check that DUNE's transport runs there and that this machine has a route to that network",
        )
    if answer is Answer.NONE:
        return problem(
            Cause.NO_TRAFFIC,
            f"announced, but nothing comes from {_addresses(node)}, not even to a fresh id on another port",
            f"It does not hear us or cannot answer: check the firewalls on both sides (UDP {settings.port} here), "
            "that its Transports.UDP is enabled, and that the network passes unicast both ways",
        )
    if node.state is NodeState.ANNOUNCED and node.telemetry_overdue:
        return problem(
            Cause.NO_TRAFFIC,
            f"announced, but nothing comes from {_addresses(node)}",
            f"{node.reason}. With the service stopped `bathyfleet doctor` tells which it is",
        )
    return note(Cause.NO_TRAFFIC, f"no packet from {node.address} yet", "Listen for longer")


def _addresses(node: NodeView) -> str:
    return ", ".join(f"{host}:{port}" for host, port in node.addresses)


def _state_findings(node: NodeView, dropped: int) -> list[Finding]:
    rate = node.rates_hz.get("EstimatedState", 0.0)
    if rate >= MIN_STATE_RATE_HZ and (node.position_age_s is None or node.without_position):
        since = "" if node.position_age_s is None else f" for {node.position_age_s:.0f} s"
        text = f"EstimatedState at {rate:.1f} Hz from {node.address}, and no position in any{since}"
        return [problem(Cause.LOW_RATE, text, "Wait for its GPS fix; where it has one its navigation has failed")]
    if rate >= MIN_STATE_RATE_HZ:
        return [ok(f"EstimatedState at {rate:.1f} Hz from {node.address}; rates: {node.rate_limiters}")]
    if dropped:
        text = f"EstimatedState at {rate:.1f} Hz, as far as it was read: this machine threw {dropped} packets away"
        return [note(Cause.PACKETS_DROPPED, text, "See what is said of this machine above; the vehicle may be fine")]
    return [
        problem(
            Cause.LOW_RATE,
            f"EstimatedState at {rate:.1f} Hz",
            "Check that navigation runs on board and that the link is not saturated",
        )
    ]


def _sounding_findings(node: NodeView, *, live: bool) -> list[Finding]:
    if node.entities is None and not live:
        return [note(Cause.NO_ENTITIES, "entity names unknown: nobody asked for them in this recording")]
    if node.entities is None:
        return [
            problem(Cause.NO_ENTITIES, "entity names unknown", "It does not answer EntityList: does it hear us?"),
        ]
    findings = [
        ok(f"bottom measured by {', '.join(node.bottom_sensors)}")
        if node.bottom_sensors
        else problem(
            Cause.NO_SOUNDINGS,
            "no Distance from a bottom-looking sensor, and no SonarData of a multibeam",
            "Switch on the altimeter or DVL (entities Altimeter, DVL Filtered, DVL Beam 0..3, DVL - Beam 0..3)",
        )
    ]
    findings += [
        note(Cause.SOUNDINGS_REFUSED, f"{count} {what} refused: {reason}")
        for what, refused in (("Distances", node.refused), ("pings", node.pings_refused))
        for reason, count in sorted(refused.items())
    ]
    return findings


def _way_home_findings(node: NodeView, settings: BridgeSettings) -> list[Finding]:
    """Whether DUNE would start a way home that is stored on board, and when."""
    if node.runs_lost_comms is None:
        return []
    if not node.runs_lost_comms:
        return [note(Cause.NO_WAY_HOME, NOT_ON_BOARD.reason, NOT_ON_BOARD.remedy)]
    if node.lost_comms is None:
        text = "its task LostComms runs, but does not tell how it is configured"
        return [note(Cause.NO_WAY_HOME, text, f"Its Plan Name has to be {DEFAULT_PLAN_NAME!r}")]
    plan, timeout = node.lost_comms.plan_name, node.lost_comms.timeout
    findings = [ok(f"its task LostComms starts plan {plan!r} after {timeout} s without a console")]
    if settings.id not in DUNE_CONSOLE_IDS:
        first, last = DUNE_CONSOLE_IDS[0], DUNE_CONSOLE_IDS[-1]
        findings.append(
            note(
                Cause.NO_WAY_HOME,
                f"to that task id 0x{settings.id:04X} is no console: a vehicle whose plan failed goes home although it "
                "hears us",
                f"Where that is not wanted set imc.id to one from 0x{first:04X} to 0x{last:04X}",
            )
        )
    return findings


def _clock_findings(node: NodeView, settings: BridgeSettings) -> list[Finding]:
    scale, rate, offset = settings.time_scale, node.clock_rate, node.clock_offset_s
    if rate is not None and not SLOWEST_RATE < rate / scale < FASTEST_RATE:
        return [
            problem(
                Cause.CLOCK_RATE,
                f"its clock runs {rate:.1f} times as fast as ours, where time_scale is {scale:g}",
                f"For a simulation set time_scale = {rate:.3g}, so that references and deadlines keep its pace",
            )
        ]
    if offset is None or abs(offset) <= CLOCK_TOLERANCE_S or scale != 1.0:
        return []
    side = "ahead of" if offset > 0 else "behind"
    text = f"its clock is {_duration(abs(offset))} {side} ours"
    remedy = "Synchronise both by NTP or GPS: tides and times in products are taken from it"
    say = problem if abs(offset) > CLOCK_WRONG_S else note
    return [say(Cause.CLOCK_OFF, text, remedy)]


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    if seconds < 7200.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h" if seconds < 172_800.0 else f"{seconds / 86_400.0:.1f} days"


def _plan_findings(node: NodeView, settings: BridgeSettings) -> list[Finding]:
    if node.state is NodeState.READY and not node.without_position:
        return [ok("in service and ready for a plan")]
    if node.state is NodeState.LOST:
        return []
    if node.controller not in (None, settings.id, 0xFFFF):
        return [
            note(
                Cause.FOREIGN_CONTROL,
                f"its maneuver takes references from console 0x{node.controller:04X} only; ours is 0x{settings.id:04X}",
                "Stop that plan on its console before a mission",
            )
        ]
    remedy = ""
    if node.goes_home:
        remedy = "Let it come home, or stop it first"
    elif node.state is NodeState.IN_PLAN and not node.ours:
        remedy = "Stop that plan on its console before a mission"
    elif node.state is NodeState.ACTIVE:
        remedy = "Clear what the vehicle reports before a mission"
    return [note(Cause.NOT_READY, node.reason or node.state.value, remedy)]
