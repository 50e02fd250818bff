"""DUNE's supervisor ``Supervisors/AUV/LostComms``: starts a plan that was stored for it when no console is heard.

It learns of the plan as that is stored, not from the database, and forgets it with a restart of DUNE. An abort switches
it off until the plan is stored again. Deleting the plan from the database does not disarm it; a request to store the
plan that carries none does.
"""

from __future__ import annotations

from enum import Enum

import imcpy

from simulator.dune.plan import OpMode, Outcome, PlanEngine, PlanState

ENTITY = "Lost Comms"
PLAN_NAME = "lostcomms"
TIMEOUT_S = 300.0
PERIOD_S = 2.0
_IDLE = (PlanState.BLOCKED, PlanState.READY)
_CONSOLES = (0x4000, 0x5000)
"""High digits of the ids that DUNE takes for consoles'; heartbeats of other systems do not count."""


class _State(Enum):
    NOT_MET = "not met"
    STARTED = "timer started"
    EXECUTING = "plan sent"


class LostComms:
    """The supervisor of one vehicle.

    Parameters
    ----------
    timeout_s
        So long no console may be heard.
    plan_name
        What the stored plan is called.
    """

    def __init__(self, timeout_s: float = TIMEOUT_S, plan_name: str = PLAN_NAME) -> None:
        self.timeout_s = timeout_s
        self.plan_name = plan_name
        self.active = False
        self._plan: imcpy.PlanSpecification | None = None
        self._state = _State.NOT_MET
        self._since_s = 0.0

    def parameters(self) -> dict[str, str]:
        """What it answers when it is asked for its parameters."""
        return {"Plan Name": self.plan_name, "Lost Comms Timeout": f"{self.timeout_s:g}"}

    def stored(self, request: imcpy.PlanDB) -> None:
        """Take a request to the plan database in: another plan, or none."""
        if (
            request.type != imcpy.PlanDB.TypeEnum.REQUEST
            or request.op != imcpy.PlanDB.OperationEnum.SET
            or request.plan_id != self.plan_name
        ):
            return
        self._plan = request.arg if isinstance(request.arg, imcpy.PlanSpecification) else None
        self.active = self.active or self._plan is not None

    def aborted(self) -> None:
        """Switch off."""
        self.active = False

    def heard(self, source: int, now_s: float) -> None:
        """Take a heartbeat in."""
        if source & 0xF000 in _CONSOLES:
            self._since_s = now_s

    def tick(self, engine: PlanEngine, *, submerged: bool, now_s: float) -> imcpy.PlanControl | None:
        """Look at the vehicle's state; return the request that starts the plan once it is due."""
        if not self.active or self._plan is None:
            return None
        failed = (
            engine.op_mode in (OpMode.SERVICE, OpMode.ERROR)
            and engine.plan_state in _IDLE
            and engine.outcome is Outcome.FAILURE
        )
        if self._state is _State.EXECUTING and engine.plan_state in _IDLE:
            self._state = _State.NOT_MET
        elif self._state is _State.NOT_MET and failed and not submerged:
            self._state, self._since_s = _State.STARTED, now_s
        elif self._state is _State.STARTED and not failed:
            self._state = _State.NOT_MET
        elif self._state is _State.STARTED and now_s - self._since_s >= self.timeout_s:
            self._state = _State.EXECUTING
            return self._start(self._plan)
        return None

    def _start(self, plan: imcpy.PlanSpecification) -> imcpy.PlanControl:
        request = imcpy.PlanControl()
        request.type = imcpy.PlanControl.TypeEnum.REQUEST
        request.op = imcpy.PlanControl.OperationEnum.START
        request.plan_id = self.plan_name
        request.flags = int(imcpy.PlanControl.FlagsBits.IGNORE_ERRORS)
        request.arg = plan
        return request
