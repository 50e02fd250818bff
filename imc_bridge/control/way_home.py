"""A way home that a vehicle keeps on board, for when it hears nobody any more.

DUNE's task Supervisors/AUV/LostComms starts it: at the surface, in service or in error, after a plan that failed or was
stopped, when it has heard no heartbeat of a console (ids 0x4000 to 0x5FFF) for some minutes. What that asks for:

- It learns of the plan when that is stored under the name it is configured with, and forgets it when DUNE restarts.
- An abort switches it off until the plan is stored again.
- Deleting the plan from the database does not disarm it; a request to store it that carries no plan does.
- A stop from here leaves a stopped plan behind, so a vehicle that was stopped is disarmed until it is engaged again.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import StrEnum

import imcpy

from imc_bridge.control.altitude_guard import FARTHEST_M, AltitudeGuard
from imc_bridge.control.control import Refusal
from imc_bridge.control.depth_layers import ALONE, DepthLayer
from imc_bridge.control.plans import HOME_RADIUS_M, goto_maneuver, goto_plan, station_maneuver
from imc_bridge.distances import Place, distance_m
from imc_bridge.events import NodeState, Waypoint
from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text
from imc_bridge.nodes.lost_comms import DEFAULT_PLAN_NAME
from imc_bridge.nodes.node import Node, home_prefix
from imc_bridge.nodes.status import status_of
from imc_bridge.settings import BridgeSettings

RETRY_S = 2.0
TRIES = 5
LATER_S = 30.0
"""A vehicle that did not answer is asked again this much later."""
MOST_PLACES = 100
_Operation = imcpy.PlanDB.OperationEnum
_SUCCESS, _FAILURE = int(imcpy.PlanDB.TypeEnum.SUCCESS), int(imcpy.PlanDB.TypeEnum.FAILURE)
_OUT_OF_REACH = (NodeState.HEARD, NodeState.ANNOUNCED, NodeState.LOST, NodeState.EXPECTED_OFFLINE)
NOT_ON_BOARD = Refusal(
    "nothing on board would start a way home: its task LostComms is not enabled",
    "Set Enabled = Hardware, Simulation in [Supervisors.AUV.LostComms] of DUNE's configuration",
)


class OnboardStep(StrEnum):
    """What is to be done next on board."""

    NOTHING = "nothing"
    WAIT = "wait for the task's parameters"
    STORE = "store"
    DISARM = "disarm"
    DELETE = "delete"


class WayHome:
    """The way home of one vehicle.

    Parameters
    ----------
    node
        What is known of the vehicle.
    settings
    send
        Sends a message to the vehicle.
    request_ids
        Numbers for requests.
    """

    def __init__(
        self,
        node: Node,
        settings: BridgeSettings,
        send: Callable[[Message], None],
        request_ids: itertools.count[int],
    ) -> None:
        self.refusal: Refusal | None = None
        """Why it is not on board as it should be."""
        self._node = node
        self._settings = settings
        self._send = send
        self._request_ids = request_ids
        self._way: tuple[Waypoint, ...] = ()
        self._stopped = False
        self._step = OnboardStep.NOTHING
        self._tries = 0
        self._due = -math.inf
        self._request_id = -1

    @property
    def wanted(self) -> bool:
        """Whether there is one, or one is still to be removed."""
        return bool(self._way) or self._step is not OnboardStep.NOTHING

    @property
    def busy(self) -> bool:
        """Whether an answer is still to be expected."""
        return self._step is not OnboardStep.NOTHING and self.refusal is None

    @property
    def text(self) -> str:
        """How far it has come, in words; empty when there is none."""
        if self.refusal is not None:
            return f"not kept: {self.refusal.reason}"
        if self._step in (OnboardStep.WAIT, OnboardStep.STORE):
            return "being stored"
        if not self._way:
            return ""
        if self._stopped:
            return "disarmed while it is stopped"
        task = self._node.lost_comms
        return "kept on board" + (f", started after {task.timeout} s without a console" if task is not None else "")

    # What the bridge's user asks

    def keep(self, way: Sequence[Waypoint]) -> None:
        """Store this way in place of the former one, unless it is there already."""
        there = self._step is OnboardStep.NOTHING and self.refusal is None and not self._stopped
        if not there or tuple(way) != self._way:
            self._way = tuple(way)
            self._store()

    def drop(self) -> None:
        """Leave nothing on board."""
        self._way = ()
        self._next(OnboardStep.DISARM)

    def stopped(self) -> None:
        """Disarm it: the vehicle was stopped, and stays where it is."""
        if self._way and not self._stopped:
            self._stopped = True
            self._next(OnboardStep.DISARM)

    def engaged(self) -> None:
        """Store it again, which arms it after a stop, an abort or a restart."""
        if self._way:
            self._store()

    # What the vehicle says

    def restarted(self) -> None:
        """DUNE has restarted: its task has forgotten the plan."""
        if self._way and not self._stopped:
            self._store()

    def replied(self, message: Message) -> None:
        """PlanDB to us: whether it was done."""
        kind = int(message.type)
        if int(message.request_id) != self._request_id or kind not in (_SUCCESS, _FAILURE):
            return
        match self._step:
            case OnboardStep.STORE if kind == _SUCCESS:
                self._next(OnboardStep.NOTHING)
            case OnboardStep.STORE:
                self._next(OnboardStep.NOTHING)
                reason = f"its plan database refuses the way home: {text(message, 'info') or 'no reason given'}"
                self.refusal = Refusal(reason, "Look at the vehicle's own log")
            case OnboardStep.DISARM:
                # Without a plan the database always refuses; the task has heard it all the same.
                self._next(OnboardStep.DELETE)
            case OnboardStep.DELETE:
                self._next(OnboardStep.NOTHING)

    # The passing of time

    def tick(self, now: float) -> None:
        """Send what is due."""
        if self._step is OnboardStep.NOTHING:
            return
        if status_of(self._node, now).state in _OUT_OF_REACH:
            self._unconfirmed("it is out of reach", now)
        elif self._step is OnboardStep.WAIT:
            self._wait(now)
        elif now < self._due:
            return
        elif self._tries >= TRIES:
            self._unconfirmed(f"no answer of its plan database to {TRIES} requests", now + LATER_S)
        else:
            self._count(now)
            self._send(self._request())

    def _wait(self, now: float) -> None:
        """Wait until it is known how the task is configured; whoever does not tell has DUNE's defaults, likely."""
        node = self._node
        if node.entities is not None and node.lost_comms_task is None:
            self._next(OnboardStep.NOTHING)
            self.refusal = NOT_ON_BOARD
        elif node.lost_comms is not None or self._tries >= TRIES:
            self._next(OnboardStep.STORE)
        elif now >= self._due:
            self._count(now)

    def _store(self) -> None:
        self._stopped = False
        self._next(OnboardStep.WAIT)

    def _count(self, now: float) -> None:
        self._tries += 1
        self._due = now + RETRY_S

    def _unconfirmed(self, reason: str, again_at: float) -> None:
        words = f"what it is to keep as its way home is not confirmed: {reason}"
        self.refusal = Refusal(words, "It is sent again when the vehicle answers")
        self._tries, self._due = 0, again_at

    def _next(self, step: OnboardStep) -> None:
        self._step, self._tries, self._due, self.refusal = step, 0, -math.inf, None
        self._request_id = next(self._request_ids) & 0xFFFF

    def _request(self) -> Message:
        request = imcpy.PlanDB()
        request.type = imcpy.PlanDB.TypeEnum.REQUEST
        request.op = _Operation.DEL if self._step is OnboardStep.DELETE else _Operation.SET
        request.request_id = self._request_id
        task = self._node.lost_comms
        request.plan_id = DEFAULT_PLAN_NAME if task is None else task.plan_name
        if self._step is OnboardStep.STORE:
            request.arg = home_plan(request.plan_id, home_prefix(self._settings.plan_id), self._way)
        return request


def home_plan(plan_id: str, prefix: str, way: Sequence[Waypoint]) -> Message:
    """A plan along a way, which ends with staying at its last place at the surface.

    Its maneuvers' names begin with ``prefix``, by which a vehicle that executes it shows whose plan it is.
    """
    steps = [(f"{prefix} {k}", goto_maneuver(place, place.depth_m)) for k, place in enumerate(way, 1)]
    return goto_plan(plan_id, [*steps, (f"{prefix} end", station_maneuver(way[-1], 0.0, HOME_RADIUS_M))])


def guarded(
    way: Sequence[Waypoint], guard: AltitudeGuard, node: Node, now: float, layer: DepthLayer = ALONE
) -> list[Waypoint]:
    """The same way at depths that the bottom on it allows, as far as it is known, from where the vehicle is now.

    Others go home at other depths: ``layer`` says which is this vehicle's where the bottom leaves less than asked for.
    """
    time_s = node.clock.time_s or 0.0
    first = way[0]
    here = (first.lat_deg, first.lon_deg) if node.report is None else (node.report.lat_deg, node.report.lon_deg)
    safe = []
    for place in way:
        allowed = max(place.depth_m, layer.deepest_m if math.isfinite(layer.deepest_m) else 0.0)
        for start, end in _pieces(here, (place.lat_deg, place.lon_deg)):
            limit = guard.limit(
                allowed, place.min_altitude_m, time_s, *start, now=now, towards=(end,), mapped=place.bottom
            )
            allowed = limit.depth_m
        safe.append(replace(place, depth_m=min(place.depth_m, layer.depth_m(allowed))))
        here = (place.lat_deg, place.lon_deg)
    return safe


def _pieces(start: Place, end: Place) -> list[tuple[Place, Place]]:
    """A straight way in pieces as long as the guard looks ahead."""
    count = max(math.ceil(distance_m(start, end) / FARTHEST_M), 1)
    corners = [
        (start[0] + k / count * (end[0] - start[0]), start[1] + k / count * (end[1] - start[1]))
        for k in range(count + 1)
    ]
    return list(itertools.pairwise(corners))
