"""A node as the bridge's user sees it."""

from __future__ import annotations

from imc_bridge.events import LinkChange, NodeView
from imc_bridge.nodes.node import Node
from imc_bridge.nodes.status import status_of


def view_of(
    node: Node,
    now: float,
    scale: float,
    *,
    engaged: bool,
    history: tuple[LinkChange, ...],
    rate_limiters: str,
    way_home: str,
) -> NodeView:
    """All that is known of a node at ``now``; ``scale``: seconds of the bridge's clock per second of the wall's."""
    status = status_of(node, now)

    def age(at: float | None) -> float | None:
        return None if at is None else (now - at) / scale

    return NodeView(
        name=node.name,
        imc_id=node.imc_id,
        is_vehicle=node.is_vehicle,
        state=status.state,
        engaged=engaged,
        reason=status.reason,
        ours=node.ours,
        age_s=age(node.heard_at),
        position_age_s=age(node.report_at),
        without_position=node.without_position,
        announce_age_s=age(node.announced_at),
        telemetry_overdue=node.telemetry_overdue(now),
        address=f"{node.address[0]}:{node.address[1]}" if node.address else None,
        addresses=node.addresses,
        imc_version=node.announcement.imc_version if node.announcement else None,
        operation_mode=node.operation_mode_name,
        plan_id=node.plan_id or None,
        plan_state=node.plan_state_name,
        report=node.report,
        clock_offset_s=node.clock.offset_s,
        entities=None if node.entities is None else len(node.entities),
        controller=node.controller,
        bottom_sensors=tuple(sorted({*node.intake.heard, *node.pings.heard})),
        rates_hz=node.rates.rates_hz(now),
        soundings=node.intake.accepted,
        refused=dict(node.intake.refused),
        pings=node.pings.accepted,
        pings_refused=dict(node.pings.refused),
        echoes=node.echoes,
        relayed=node.relayed,
        foreign_address=node.foreign_address,
        foreign_from=f"{node.last_foreign[0]}:{node.last_foreign[1]}" if node.last_foreign else None,
        conflict=node.conflict,
        namesake=node.id_conflict is None and node.namesake is not None,
        clock_rate=node.clock.rate(scale),
        history=history,
        rate_limiters=rate_limiters,
        faults=node.faults.present,
        goes_home=node.home_bound,
        runs_lost_comms=None if node.entities is None else node.lost_comms_task is not None,
        lost_comms=node.lost_comms,
        way_home=way_home,
        restarts=node.boots,
        radio_gaps=node.radio_gaps,
    )
