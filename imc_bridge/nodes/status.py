"""The state of the link to a node, and the reason that an operator can act on."""

from __future__ import annotations

import math
from dataclasses import dataclass

from imc_bridge.events import NodeState
from imc_bridge.nodes.modes import OperationMode, PlanState, mode_name
from imc_bridge.nodes.node import ANNOUNCES_MISSED, NO_POSITION, Node
from imc_bridge.settings import BridgeSettings


@dataclass(frozen=True, slots=True)
class Status:
    """A link state with the reason an operator can act on."""

    state: NodeState
    reason: str = ""


def status_of(node: Node, now: float) -> Status:
    """The link's state and the reason for it."""
    status = _of_contact(node, now)
    if node.without_position and status.state in (NodeState.READY, NodeState.IN_PLAN):
        return Status(status.state, "; ".join(filter(None, (status.reason, NO_POSITION))))
    return status


def _of_contact(node: Node, now: float) -> Status:
    settings = node.settings
    if node.announcement is None:
        ports = f"{settings.announce_ports[0]}-{settings.announce_ports[-1]}"
        return Status(
            NodeState.HEARD,
            f"packets arrive but no announce: let it announce itself to UDP ports {ports} of this machine",
        )
    if node.address is None:
        return Status(NodeState.HEARD, "its announce names no imc+udp address: enable its UDP transport")
    if node.heard_at is None and node.announced_at is not None and node.first_announced_at is not None:
        return _without_telemetry(node.settings, now, node.announced_at, node.first_announced_at)
    silence = math.inf if node.heard_at is None else now - node.heard_at
    if silence > node.lost_after_s:
        return _silent(node, silence, now)
    if node.operation_mode is None or node.plan_state is None:
        return Status(NodeState.ACTIVE, "waiting for its VehicleState and PlanControlState")
    if node.runs_plan:
        if node.plan_state == PlanState.INITIALIZING:
            return Status(NodeState.IN_PLAN, "starts a plan")
        if node.home_bound:
            return Status(NodeState.IN_PLAN, "goes home by the plan that it keeps on board for that")
        return Status(NodeState.IN_PLAN, f"executes {_whose_plan(node)}")
    if node.operation_mode == OperationMode.SERVICE and node.plan_state == PlanState.READY:
        return Status(NodeState.READY)
    return Status(NodeState.ACTIVE, _why_not_ready(node))


def _whose_plan(node: Node) -> str:
    if node.ours:
        return "our plan"
    plan = f"plan {node.plan_id!r}"
    if node.runs_peers_plan:
        return f"{plan} of a peer of this service"
    if node.of_earlier_version:
        return (
            f"{plan} of another console, or of an earlier version of this service: wait until it has ended, or stop it "
            "from another console such as Neptus"
        )
    controller = f" (0x{node.foreign_controller:04X})" if node.foreign_controller is not None else ""
    return f"{plan} of another console{controller}"


def _without_telemetry(settings: BridgeSettings, now: float, announced_at: float, first_announced_at: float) -> Status:
    if now - announced_at > ANNOUNCES_MISSED * settings.announce_period_s:
        return Status(NodeState.LOST, "it announced itself and then fell silent")
    if now - first_announced_at <= settings.telemetry_timeout_s:
        return Status(NodeState.ANNOUNCED, "announced; its telemetry starts within 5 s of our heartbeats")
    return Status(
        NodeState.ANNOUNCED,
        "announced but sends nothing to us: it may remember "
        f"id 0x{settings.id:04X} at another port (restart DUNE or return to that port), "
        f"or a firewall blocks UDP port {settings.port}",
    )


def _silent(node: Node, silence: float, now: float) -> Status:
    settings = node.settings
    seconds = silence / settings.time_scale
    if node.expected_back is not None and now <= node.expected_back:
        left = (node.expected_back - now) / settings.time_scale
        return Status(
            NodeState.EXPECTED_OFFLINE,
            f"silent for {seconds:.0f} s on a leg of ours, expected back within {left:.0f} s",
        )
    away = node.expected_back is None and node.plan_state == PlanState.EXECUTING
    if away and node.submerged and silence <= node.patience_s:
        whose = "our plan" if node.ours else f"plan {node.plan_id!r}"
        comes_up = "; without references that ends and it comes up" if node.references_needed else ""
        return Status(
            NodeState.EXPECTED_OFFLINE,
            f"silent for {seconds:.0f} s, under water in {whose}: radio ends at the surface{comes_up}",
        )
    afloat = not node.runs_plan
    since_start = math.inf if node.started_at is None else now - node.started_at
    if afloat and node.submerged and min(silence, since_start) <= node.ascent_s:
        words = f"silent for {seconds:.0f} s, under water without a plan: it floats up"
        return Status(NodeState.EXPECTED_OFFLINE, words)
    where = "under water" if node.submerged else "at the surface"
    return Status(NodeState.LOST, f"silent for {seconds:.0f} s, last heard {where}")


def _why_not_ready(node: Node) -> str:
    mode = mode_name(OperationMode, node.operation_mode)
    if node.operation_mode == OperationMode.ERROR:
        return f"in error: {node.error_text or 'no text given'}"
    if node.plan_state == PlanState.BLOCKED:
        return f"refuses plans (plan control blocked, mode {mode})"
    return f"mode {mode}, plan control {mode_name(PlanState, node.plan_state)}"
