"""Plan engine and vehicle supervisor of a DUNE node: what it is doing, and what it answers to commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum

import imcpy

from simulator.dune.entities import ANY, SIMULATION
from simulator.dune.maneuvers.elevator import ElevatorManeuver
from simulator.dune.maneuvers.ending import EndingManeuver
from simulator.dune.maneuvers.follow_reference import FollowReference
from simulator.dune.maneuvers.goto import GotoManeuver
from simulator.dune.maneuvers.pop_up import PopUpManeuver
from simulator.dune.maneuvers.station_keeping import StationKeepingManeuver
from simulator.geodesy import LocalFrame
from simulator.world import SimulatedVehicle

ERROR_RECOVERY_S = 1.0
"""An aborted vehicle is back in service after this long."""
MANEUVER_LOOPS = 1225
"""Control loops that a moving vehicle reports (path, speed, depth, pitch, heading …)."""
NO_MANEUVER = 0xFFFF
NO_ETA = 0xFFFF

PLAN_ENGINE = SIMULATION["Plan Engine"]
SUPERVISOR = SIMULATION["Vehicle Supervisor"]
FOLLOW_REFERENCE = SIMULATION["Follow Reference Maneuver"]
IS_DONE = "ManeuverIsDone"

UNATTENDED_S = 1.0
"""How long a maneuver that is done waits for the plan engine; then the supervisor ends it."""

"""Maneuvers that end by themselves."""
Maneuver = FollowReference | EndingManeuver
SPECIFICATIONS = (imcpy.FollowReference, imcpy.Goto, imcpy.Elevator, imcpy.StationKeeping, imcpy.PopUp)
"""Of the maneuvers that are flown."""

Send = Callable[..., None]
"""``send(message, entity, dst=0xFFFF, dst_ent=255, src=None)``: put a message of this node on the network."""


class OpMode(IntEnum):
    """Values of ``VehicleState.op_mode``."""

    SERVICE = 0
    CALIBRATION = 1
    ERROR = 2
    MANEUVER = 3
    EXTERNAL = 4
    BOOT = 5


class PlanState(IntEnum):
    """Values of ``PlanControlState.state``."""

    BLOCKED = 0
    READY = 1
    INITIALIZING = 2
    EXECUTING = 3


class Outcome(IntEnum):
    """Values of ``PlanControlState.last_outcome``."""

    NONE = 0
    SUCCESS = 1
    FAILURE = 2


class PlanEngine:
    """Executes one plan at a time: a FollowReference, or maneuvers that end by themselves, one after the other.

    Parameters
    ----------
    vehicle, imc_id, frame
        Whom it commands, under which id, and where its local frame lies.
    send
        Puts messages on the network.
    ready_s
        The vehicle's clock when it will have started up.
    stored
        Plans on board, by name.
    """

    def __init__(
        self,
        vehicle: SimulatedVehicle,
        imc_id: int,
        frame: LocalFrame,
        send: Send,
        ready_s: float,
        stored: Mapping[str, imcpy.PlanSpecification] | None = None,
    ) -> None:
        self._stored = stored if stored is not None else {}
        self.op_mode = OpMode.BOOT
        self.plan_state = PlanState.BLOCKED
        self.outcome = Outcome.NONE
        self.maneuver: Maneuver | None = None
        self._maneuver_type = NO_MANEUVER
        self._plan: dict[str, imcpy.Message] = {}
        self._after: dict[str, str] = {}
        self._vehicle = vehicle
        self._vehicle_id = imc_id
        self._frame = frame
        self._send = send
        self._service_at_s: float | None = ready_s
        self._plan_id = ""
        self._maneuver_id = ""
        self._started_s = -1.0
        self._last_error = ""
        self._last_error_s = -1.0
        self._error_entity = ""
        self._request: tuple[int, int, int] = (0, ANY, 0)
        self._done_s: float | None = None
        self._command_id = 0
        self._last_command = imcpy.VehicleCommand.CommandEnum.STOP_MANEUVER

    def on_plan_control(self, message: imcpy.PlanControl, now_s: float) -> None:
        """Answer a PlanControl request."""
        if message.type != imcpy.PlanControl.TypeEnum.REQUEST:
            return
        request = (int(message.src), int(message.src_ent), int(message.request_id))
        if message.op == imcpy.PlanControl.OperationEnum.START:
            self._start(message, request, now_s)
        elif message.op == imcpy.PlanControl.OperationEnum.STOP:
            self._stop(message, request)
        else:
            self._reply(message.op, request, message.plan_id, "operation not supported by the simulator", ok=False)

    def on_reference(self, message: imcpy.Reference, now_s: float) -> None:
        """Follow a Reference if it comes from the controlling system; others are ignored without a word."""
        maneuver = self.maneuver
        if not isinstance(maneuver, FollowReference) or not maneuver.accepts(message):
            return
        if maneuver.follow(message, now_s):
            self._complete()
        else:
            self._send(maneuver.state_message(), FOLLOW_REFERENCE)

    def on_abort(self, source: str, now_s: float) -> None:
        """Stop at once: ERROR and BLOCKED, back in service a second later."""
        if self.op_mode is OpMode.BOOT:
            return
        running = self.maneuver is not None
        self._halt()
        self._error(f"got abort request from system {source}", now_s)
        self.op_mode, self.plan_state = OpMode.ERROR, PlanState.BLOCKED
        self.outcome = Outcome.FAILURE
        if running:
            self._reply_to_start(self._last_error, ok=False)
        self._send_plan_state()
        self._send_vehicle_state()
        self._service_at_s = now_s + ERROR_RECOVERY_S

    def break_down(self, entity: str, text: str, now_s: float) -> None:
        """Be in error, by the fault of an entity, until it is mended."""
        self._error_entity = entity
        running = self.maneuver is not None
        self._halt()
        self._error(text, now_s)
        if running:
            self.outcome = Outcome.FAILURE
            self._reply_to_start(text, ok=False)
        self._into_service()

    def mend(self) -> None:
        """Be in service again."""
        self._error_entity = ""
        if self.maneuver is None:
            self._into_service()

    def miss_vehicle_state(self) -> None:
        """Have had no state of the supervisor for too long: the engine calls itself blocked, the maneuver goes on.

        So it stays until the vehicle is in service again or another plan is started; a STOP has no effect meanwhile.
        """
        self.plan_state = PlanState.BLOCKED
        self._send_plan_state()

    def tick(self, now_s: float) -> None:
        """Let time pass: start-up, recovery, time-outs."""
        if self._service_at_s is not None and now_s >= self._service_at_s:
            self._service_at_s = None
            self._into_service()
        if self.maneuver is None:
            return
        failure = self.maneuver.failure(now_s)
        if failure is None:
            if not isinstance(self.maneuver, FollowReference) and self.maneuver.done(now_s):
                self._maneuver_done(now_s)
            return
        text, is_error = failure
        if not is_error and isinstance(self.maneuver, FollowReference):
            self._send(self.maneuver.state_message(), FOLLOW_REFERENCE)
        self._halt()
        self._error(text, now_s)
        self.outcome = Outcome.FAILURE
        if is_error:
            broken, self._error_entity = self._error_entity, text.partition(":")[0]
            self.op_mode = OpMode.ERROR
            self._send_vehicle_state()
            self._reply_to_start(text, ok=False)
            self.plan_state = PlanState.BLOCKED
            self._send_plan_state()
            self._error_entity = broken
        else:
            self._reply_to_start(text, ok=False)
        self._into_service()

    def vehicle_state(self) -> imcpy.VehicleState:
        """The present VehicleState."""
        message = imcpy.VehicleState()
        message.op_mode = imcpy.VehicleState.OperationModeEnum(int(self.op_mode))
        maneuvering = self.maneuver is not None
        message.maneuver_type = self._maneuver_type if maneuvering else NO_MANEUVER
        message.maneuver_stime = self._started_s if maneuvering else -1.0
        message.maneuver_eta = NO_ETA
        moving = maneuvering and self._vehicle.vehicle.guidance.value != "idle"
        message.control_loops = MANEUVER_LOOPS if moving else 0
        message.error_count = 1 if self._error_entity else 0
        message.error_ents = self._error_entity
        message.last_error = self._last_error
        message.last_error_time = self._last_error_s
        return message

    def plan_control_state(self) -> imcpy.PlanControlState:
        """The present PlanControlState."""
        message = imcpy.PlanControlState()
        executing = self.plan_state is PlanState.EXECUTING
        message.state = imcpy.PlanControlState.StateEnum(int(self.plan_state))
        message.plan_id = self._plan_id
        message.plan_eta = -1 if executing else 0
        message.plan_progress = -1.0
        message.man_id = self._maneuver_id if executing else ""
        message.man_type = self._maneuver_type if executing else NO_MANEUVER
        message.man_eta = NO_ETA
        message.last_outcome = imcpy.PlanControlState.LastPlanOutcomeEnum(int(self.outcome))
        return message

    def _start(self, message: imcpy.PlanControl, request: tuple[int, int, int], now_s: float) -> None:
        ignores_errors = int(message.flags) & int(imcpy.PlanControl.FlagsBits.IGNORE_ERRORS)
        if self.op_mode is OpMode.BOOT or (self.op_mode is OpMode.ERROR and not ignores_errors):
            self._reply(message.op, request, message.plan_id, f"vehicle is in {self.op_mode.name} mode", ok=False)
            return
        specification, problem = _plan_of(message, self._stored)
        if specification is None:
            self._reply(message.op, request, message.plan_id, problem, ok=False)
            return
        self._halt()
        self._plan = {item.maneuver_id: item.data for item in specification.maneuvers}
        self._after = {item.source_man: item.dest_man for item in specification.transitions}
        self._request = request
        self.outcome = Outcome.NONE
        self._plan_id = ""
        self.plan_state = PlanState.INITIALIZING
        self._send_plan_state()
        self._plan_id = message.plan_id
        self._reply_to_start("plan loaded", ok=True)
        self._send(specification, PLAN_ENGINE, self._vehicle_id, ANY, request[0])
        self._execute(specification.start_man_id, now_s)

    def _execute(self, maneuver_id: str, now_s: float) -> None:
        """Begin a maneuver of the plan."""
        maneuver = self._plan[maneuver_id]
        self._maneuver_id, self._maneuver_type = maneuver_id, int(maneuver.msg_id)
        command = self._command(imcpy.VehicleCommand.CommandEnum.EXEC_MANEUVER)
        command.maneuver = maneuver
        self._send(command, PLAN_ENGINE)
        self.plan_state = PlanState.EXECUTING
        self._send_plan_state()
        self._reply_to_start(f"{maneuver_id}: executing maneuver", ok=True)
        self.op_mode = OpMode.MANEUVER
        self._started_s = now_s
        self._last_error, self._last_error_s = "", -1.0
        self._done_s = None
        self.maneuver = self._begun(maneuver, now_s)
        if isinstance(self.maneuver, FollowReference):
            self._send(self.maneuver.state_message(), FOLLOW_REFERENCE)
        self._send_vehicle_state()
        self._answer_command(f"{maneuver.msg_name} maneuver started")

    def _begun(self, spec: imcpy.Message, now_s: float) -> Maneuver:
        of = self._vehicle, self._frame, now_s
        match spec:
            case imcpy.Goto():
                return GotoManeuver(spec, *of)
            case imcpy.Elevator():
                return ElevatorManeuver(spec, *of)
            case imcpy.StationKeeping():
                return StationKeepingManeuver(spec, *of)
            case imcpy.PopUp():
                return PopUpManeuver(spec, *of)
            case _:
                return FollowReference(spec, *of)

    def _maneuver_done(self, now_s: float) -> None:
        """Go on; an engine that calls itself blocked does not, and the supervisor ends the maneuver."""
        if self.plan_state is not PlanState.BLOCKED:
            self._next(now_s)
        elif self._done_s is None:
            self._done_s = now_s
        elif now_s - self._done_s >= UNATTENDED_S:
            self._halt()
            self._into_service()

    def _next(self, now_s: float) -> None:
        """A maneuver is done: go on with the one that follows it, or end the plan."""
        following = self._after.get(self._maneuver_id)
        if following is None:
            self._complete()
        else:
            self._execute(following, now_s)

    def _stop(self, message: imcpy.PlanControl, request: tuple[int, int, int]) -> None:
        if self.maneuver is None or self.plan_state is PlanState.BLOCKED:
            self._reply(message.op, request, "", "no plan is running, request ignored", ok=False)
            return
        self._halt()
        self._send(self._command(imcpy.VehicleCommand.CommandEnum.STOP_MANEUVER), PLAN_ENGINE)
        self._reply(message.op, request, self._plan_id, "plan completed", ok=True)
        # A plan that is stopped has not been completed.
        self.outcome = Outcome.FAILURE
        self._into_service()
        self._answer_command("OK")

    def _complete(self) -> None:
        """The controlling system ended the maneuver, or the last one of the plan is done."""
        state = self.vehicle_state()
        state.maneuver_eta = 0
        state.flags = 1
        self._send(state, SUPERVISOR)
        self._halt()
        self._send(self._command(imcpy.VehicleCommand.CommandEnum.STOP_MANEUVER), PLAN_ENGINE)
        self._reply_to_start("plan completed", ok=True)
        self.outcome = Outcome.SUCCESS
        self._into_service()
        self._answer_command("OK")

    def _halt(self) -> None:
        self.maneuver = None
        self._vehicle.stop()

    def _into_service(self) -> None:
        """Be ready for plans, unless something is broken."""
        if self._error_entity:
            self.op_mode, self.plan_state = OpMode.ERROR, PlanState.BLOCKED
        else:
            self.op_mode, self.plan_state = OpMode.SERVICE, PlanState.READY
        self._send_plan_state()
        self._send_vehicle_state()

    def _error(self, text: str, now_s: float) -> None:
        self._last_error, self._last_error_s = text, now_s

    def _send_vehicle_state(self) -> None:
        self._send(self.vehicle_state(), SUPERVISOR)

    def _send_plan_state(self) -> None:
        self._send(self.plan_control_state(), PLAN_ENGINE)

    def _reply_to_start(self, info: str, *, ok: bool) -> None:
        self._reply(imcpy.PlanControl.OperationEnum.START, self._request, self._plan_id, info, ok=ok)

    def _reply(
        self,
        op: imcpy.PlanControl.OperationEnum,
        request: tuple[int, int, int],
        plan_id: str,
        info: str,
        *,
        ok: bool,
    ) -> None:
        reply = imcpy.PlanControl()
        reply.type = imcpy.PlanControl.TypeEnum.SUCCESS if ok else imcpy.PlanControl.TypeEnum.FAILURE
        reply.op = op
        reply.request_id = request[2]
        reply.plan_id = plan_id
        reply.info = info
        if self._plan_id:
            statistics = imcpy.PlanStatistics()
            statistics.plan_id = self._plan_id
            statistics.properties = 2
            reply.arg = statistics
        self._send(reply, PLAN_ENGINE, request[0], request[1])

    def _command(self, command: imcpy.VehicleCommand.CommandEnum) -> imcpy.VehicleCommand:
        self._command_id += 1
        message = imcpy.VehicleCommand()
        message.type = imcpy.VehicleCommand.TypeEnum.REQUEST
        message.request_id = self._command_id
        message.command = command
        self._last_command = command
        return message

    def _answer_command(self, info: str) -> None:
        message = imcpy.VehicleCommand()
        message.type = imcpy.VehicleCommand.TypeEnum.SUCCESS
        message.request_id = self._command_id
        message.command = self._last_command
        message.info = info
        self._send(message, SUPERVISOR, self._vehicle_id, PLAN_ENGINE)


def _plan_of(
    message: imcpy.PlanControl, stored: Mapping[str, imcpy.PlanSpecification]
) -> tuple[imcpy.PlanSpecification | None, str]:
    """The plan that a request starts, given with it or stored on board, or else what is wrong with it."""
    argument = message.arg if message.arg is not None else stored.get(message.plan_id)
    if argument is None:
        return None, "undefined plan"
    if isinstance(argument, SPECIFICATIONS):
        plan = imcpy.PlanSpecification()
        plan.plan_id = message.plan_id
        plan.start_man_id = argument.msg_name
        item = imcpy.PlanManeuver()
        item.maneuver_id = argument.msg_name
        item.data = argument
        plan.maneuvers.append(item)
        return plan, ""
    if not isinstance(argument, imcpy.PlanSpecification):
        return None, "plan load failed: undefined maneuver or plan"
    known = {item.maneuver_id: item.data for item in argument.maneuvers}
    wanted = [argument.start_man_id, *(item.dest_man for item in argument.transitions)]
    for maneuver_id in wanted:
        if maneuver_id not in known:
            return None, f"plan validation failed: {maneuver_id}: invalid maneuver ID"
        data = known[maneuver_id]
        if not isinstance(data, SPECIFICATIONS):
            name = "no maneuver" if data is None else data.msg_name
            return None, f"plan validation failed: {name} is not supported"
    for item in argument.transitions:
        if item.conditions != IS_DONE:
            return None, f"plan validation failed: {item.conditions}: condition not supported"
    return argument, ""
