"""Watches how the link to each node changes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from imc_bridge.control.control import Control
from imc_bridge.events import LinkChange, NodeState
from imc_bridge.nodes.node import Node
from imc_bridge.nodes.status import status_of

KEPT = 32
"""Changes of a link that are kept, with their times and reasons."""


class Links:
    """The changes of every node's link.

    Parameters
    ----------
    tell
        Receives each new one.
    wall_clock
        Unix seconds.
    """

    def __init__(self, tell: Callable[[LinkChange], None], wall_clock: Callable[[], float]) -> None:
        self._tell = tell
        self._wall_clock = wall_clock
        self._past: dict[int, deque[LinkChange]] = {}

    def history(self, node: Node) -> tuple[LinkChange, ...]:
        """The last changes, oldest first."""
        return tuple(self._past.get(node.imc_id, ()))

    def forget(self, node: Node) -> None:
        """Keep nothing of a node that has lost its place."""
        self._past.pop(node.imc_id, None)

    def check(self, node: Node, control: Control | None, now: float) -> None:
        """Tell when a node's link is not as it was."""
        status = status_of(node, now)
        engaged = control is not None and control.engaged
        past = self._past.setdefault(node.imc_id, deque(maxlen=KEPT))
        known = past[-1] if past else None
        reason = status.reason
        if control is not None and not engaged and control.refusal is not None and not reason:
            reason = f"not ours: {control.refusal.reason}"
        now_it_is = (node.name, status.state, engaged)
        same = known is not None and (known.vehicle, known.state, known.engaged) == now_it_is
        # The seconds in the reason for a silence are no news.
        silent = status.state in (NodeState.LOST, NodeState.EXPECTED_OFFLINE)
        if same and (silent or (known is not None and known.reason == reason)):
            return
        change = LinkChange(node.name, status.state, engaged, reason, node.ours, self._wall_clock(), node.home_bound)
        past.append(change)
        self._tell(change)
