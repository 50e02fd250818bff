"""What the doctor found, as REST and the dashboard show it."""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime

from pydantic import Field

from app.missions.views.base import View
from app.missions.views.traffic import TrafficFinding
from imc_bridge.doctor.diagnosis import Cause, Diagnosis, NodeDiagnosis, Severity, problem
from imc_bridge.doctor.diagnosis import Finding as BridgeFinding
from imc_bridge.events import NodeState

Examine = Callable[[], Diagnosis]


class Finding(View):
    """One observation, and what to do about it."""

    severity: Severity
    cause: Cause = Field(description="For programs; the texts may change")
    text: str
    remedy: str = ""


class LinkRecord(View):
    """One change of a vehicle's link."""

    at: datetime
    state: NodeState
    engaged: bool = Field(description="Whether the vehicle followed us")
    reason: str = ""


class VehicleDiagnosis(View):
    """What was found of one vehicle."""

    name: str
    imc_id: int
    state: NodeState
    healthy: bool
    causes: list[Cause] = Field(description="Of its problems, the one to look at first in front")
    findings: list[Finding]
    history: list[LinkRecord] = Field(description="The last changes of its link, oldest first")


class DoctorView(View):
    """What keeps vehicles on the IMC network from working with this service."""

    healthy: bool = Field(description="At least one vehicle is there, and nothing stands in any one's way")
    seconds: float = Field(description="For how long was listened")
    causes: list[Cause]
    own: list[Finding] = Field(description="On this machine's side")
    vehicles: list[VehicleDiagnosis]
    traffic: list[TrafficFinding] = Field(default=[], description="Of AIS; empty where it is not set up")


def doctor_view(diagnosis: Diagnosis, traffic: Sequence[TrafficFinding] = ()) -> DoctorView:
    """Put a diagnosis into the form that goes out."""
    return DoctorView(
        healthy=diagnosis.healthy,
        seconds=diagnosis.seconds,
        causes=list(diagnosis.causes),
        own=[_finding(finding) for finding in diagnosis.own],
        vehicles=[_vehicle(node) for node in diagnosis.nodes],
        traffic=list(traffic),
    )


def switched_off() -> Diagnosis:
    """Return the diagnosis of a service that does not listen for IMC vehicles at all."""
    text = "this service does not listen for IMC vehicles"
    return Diagnosis(0.0, (problem(Cause.SWITCHED_OFF, text, "Set imc.enabled = true in the settings"),), ())


def _finding(finding: BridgeFinding) -> Finding:
    return Finding(severity=finding.severity, cause=finding.cause, text=finding.text, remedy=finding.remedy)


def _vehicle(node: NodeDiagnosis) -> VehicleDiagnosis:
    return VehicleDiagnosis(
        name=node.name,
        imc_id=node.imc_id,
        state=node.state,
        healthy=node.healthy,
        causes=list(node.causes),
        findings=[_finding(finding) for finding in node.findings],
        history=[
            LinkRecord(
                at=datetime.fromtimestamp(change.at_s, UTC),
                state=change.state,
                engaged=change.engaged,
                reason=change.reason,
            )
            for change in node.history
        ],
    )
