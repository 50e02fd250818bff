"""Why a plan ended that we did not end, and what follows from it."""

from __future__ import annotations

from dataclasses import dataclass

from imc_bridge.nodes.modes import PlanState
from imc_bridge.nodes.node import Node

STARVED_TEXT = "path control reference"
"""Part of what DUNE says when references cease: to it that is an error of its path controller."""
WHEN_CLEARED = "Engage it again when that is cleared"
WHEN_DONE = "Engage it again when that is done"


@dataclass(slots=True)
class Evidence:
    """What was seen around the end of a plan that we did not end."""

    timed_out: bool = False
    failure: str = ""
    completed: bool = False
    aborted_by: int | None = None
    stopped_by: int | None = None
    taken_by: int | None = None
    error: str | None = None
    blocked: bool = False
    """Plan control was blocked, and no maneuver went on meanwhile."""
    rebooted: bool = False
    unanswered: bool = False


@dataclass(frozen=True, slots=True)
class Ending:
    """What is made of it.

    Without a ``remedy`` the plan is started again; with one the vehicle is let go, as someone wanted. ``own``: it
    failed by the vehicle's own account.
    """

    reason: str
    remedy: str = ""
    own: bool = False


def judge_ending(seen: Evidence, node: Node, *, starved: bool) -> Ending:
    """Say why our plan ended.

    Parameters
    ----------
    seen
    node
        What the vehicle does now.
    starved
        Whether echoes were missing long enough to prove that no references reached it.
    """
    if node.home_bound:
        return Ending("it goes home: to its own mind it heard no console for too long", WHEN_DONE)
    words = seen.failure or seen.error or node.error_text or "no reason given"
    if node.plan_state == PlanState.EXECUTING and node.plan_id not in ("", node.settings.plan_id):
        return Ending(f"another console took over with plan {node.plan_id!r}", WHEN_DONE)
    if seen.taken_by is not None:
        return Ending(f"console 0x{seen.taken_by:04X} took over with a plan of the same name", WHEN_DONE)
    if seen.rebooted:
        return Ending("the vehicle has rebooted")
    if seen.aborted_by is not None:
        return Ending(f"aborted by console 0x{seen.aborted_by:04X}", WHEN_CLEARED)
    if "abort" not in words.lower() and (starved or STARVED_TEXT in words.lower()):
        return Ending("references did not reach it in time")
    if seen.error is not None or seen.blocked:
        return Ending(f"aborted elsewhere or by itself: {words}", WHEN_CLEARED)
    if seen.stopped_by is not None:
        return Ending(f"stopped by console 0x{seen.stopped_by:04X}", WHEN_CLEARED)
    if seen.completed:
        return Ending("its plan was completed by another console", WHEN_CLEARED)
    if seen.timed_out:
        return Ending("references did not reach it in time")
    if seen.unanswered:
        return Ending("it does not answer our references")
    return Ending(seen.failure or "its plan ended without a reason", own=bool(seen.failure))
