"""The lines of the checklist about what the doctor found of the mission's own vehicles."""

from collections.abc import Iterator, Sequence

from app.missions.live.mission import LiveMission
from app.missions.spec.vehicle import VehicleKind
from app.missions.views.doctor import Finding, VehicleDiagnosis
from app.missions.views.mission import CheckStatus, CheckView
from imc_bridge.doctor.diagnosis import Cause, Severity


def doctor_checks(live: LiveMission, diagnosed: Sequence[VehicleDiagnosis]) -> Iterator[CheckView]:
    """Return what was found, cause by cause: warnings where there is something to do. On deck a sounder hears nothing.

    What keeps a vehicle from being ready is a line of its link, and said there.
    """
    by_name = {one.name: one for one in diagnosed}
    for member in live.team:
        found = by_name.get(member.name) if member.spec.kind is VehicleKind.IMC else None
        if found is None:
            continue
        said = live.hub.info(member.key).reason
        of_cause: dict[Cause, list[Finding]] = {}
        for finding in found.findings:
            is_said = said != "" and (said in finding.text or said in finding.remedy)
            if finding.severity is not Severity.OK and not is_said:
                of_cause.setdefault(finding.cause, []).append(finding)
        for cause, findings in of_cause.items():
            remedies = dict.fromkeys(finding.remedy for finding in findings if finding.remedy)
            yield CheckView(
                id=f"doctor.{member.name}.{cause}",
                title=f"Doctor on {member.name}",
                status=CheckStatus.WARNING if remedies else CheckStatus.NOTE,
                message="; ".join(finding.text for finding in findings),
                remedy=". ".join(remedies),
            )
