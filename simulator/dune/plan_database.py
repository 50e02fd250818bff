"""Plan database of a DUNE node: plans that stay on board, and the answers to requests for them."""

from __future__ import annotations

from hashlib import md5

import imcpy

from simulator.dune.entities import SIMULATION

PLAN_DATABASE = SIMULATION["Plan Database"]
_Operation = imcpy.PlanDB.OperationEnum
_Type = imcpy.PlanDB.TypeEnum


class PlanDatabase:
    """Plans by name. DUNE keeps them in a file: they outlive its restart."""

    def __init__(self) -> None:
        self.plans: dict[str, imcpy.PlanSpecification] = {}
        self._noted = 0

    def answer(self, request: imcpy.PlanDB, now_s: float) -> list[imcpy.PlanDB]:
        """Carry a request out and return the replies to it."""
        if request.type != _Type.REQUEST:
            return []
        replies = []
        changes = request.op in (_Operation.SET, _Operation.DEL)
        problem, done, argument = self._carry_out(request, now_s)
        if changes and not problem.startswith(("undefined plan id", "no plan", "plan id")):
            replies.append(_reply(request, _Type.IN_PROGRESS, "in progress"))
        replies.append(_reply(request, _Type.FAILURE if problem else _Type.SUCCESS, problem or done, argument))
        return replies

    def note_started(self, request: imcpy.PlanControl, now_s: float) -> imcpy.PlanDB | None:
        """Keep a plan that comes with the request to start it; return what everyone is told of that."""
        plan, kinds = request.arg, imcpy.PlanControl
        starts = request.type == kinds.TypeEnum.REQUEST and request.op == kinds.OperationEnum.START
        if not starts or not isinstance(plan, imcpy.PlanSpecification):
            return None
        storing = imcpy.PlanDB()
        storing.op, storing.plan_id, storing.request_id = _Operation.SET, request.plan_id, self._noted
        storing.arg = plan
        self._noted = (self._noted + 1) & 0xFFFF
        problem, done, information = self._carry_out(storing, now_s)
        return None if problem else _reply(storing, _Type.SUCCESS, done, information)

    def _carry_out(self, request: imcpy.PlanDB, now_s: float) -> tuple[str, str, imcpy.Message | None]:
        """Return what is wrong with a request, or what to say to it and what to send with that."""
        name = request.plan_id
        if request.op not in (_Operation.SET, _Operation.DEL, _Operation.GET):
            return "unsupported operation", "", None
        if not name:
            return "undefined plan id", "", None
        known = name in self.plans
        if request.op == _Operation.SET:
            plan = request.arg
            if not isinstance(plan, imcpy.PlanSpecification):
                return "no plan specification given", "", None
            if plan.plan_id != name:
                return "plan id mismatch", "", None
            self.plans[name] = plan
            information = _information(plan, int(request.src), now_s)
            return "", "OK (updated)" if known else "OK (new entry)", information
        if not known:
            return "undefined plan", "", None
        if request.op == _Operation.GET:
            return "", "OK", self.plans[name]
        del self.plans[name]
        return "", "OK", None


def _information(plan: imcpy.PlanSpecification, source: int, now_s: float) -> imcpy.PlanDBInformation:
    fields = bytes(plan.serialize_fields())
    information = imcpy.PlanDBInformation()
    information.plan_id = plan.plan_id
    information.plan_size = len(fields)
    information.change_time, information.change_sid = now_s, source
    information.md5 = md5(fields, usedforsecurity=False).digest()
    return information


def _reply(
    request: imcpy.PlanDB, kind: imcpy.PlanDB.TypeEnum, info: str, argument: imcpy.Message | None = None
) -> imcpy.PlanDB:
    reply = imcpy.PlanDB()
    reply.type, reply.op = kind, request.op
    reply.request_id, reply.plan_id, reply.info = request.request_id, request.plan_id, info
    if argument is not None:
        reply.arg = argument
    return reply
