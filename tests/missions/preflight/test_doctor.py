"""What the checklist says of what the doctor found."""

import pytest

from app.missions.fleet.interface import LinkState, VehicleInfo
from app.missions.preflight.survey import preflight
from app.missions.service import MissionService
from app.missions.spec.vehicle import VehicleKind
from app.missions.views.doctor import Finding, VehicleDiagnosis
from app.missions.views.mission import CheckStatus, CheckView
from imc_bridge.doctor.diagnosis import Cause, Severity
from imc_bridge.events import NodeState
from tests.support.missions.harbour import sim_spec

NO_SOUNDINGS = Finding(
    severity=Severity.PROBLEM, cause=Cause.NO_SOUNDINGS, text="no Distance", remedy="Switch on the altimeter"
)
NO_WAY_HOME = Finding(
    severity=Severity.NOTE, cause=Cause.NO_WAY_HOME, text="LostComms is not enabled", remedy="Enable it"
)
REFUSED = [
    Finding(severity=Severity.NOTE, cause=Cause.SOUNDINGS_REFUSED, text=f"{count} Distances refused")
    for count in (3, 5)
]
HEALTHY = Finding(severity=Severity.OK, cause=Cause.SOUND, text="IMC 5.4.30")
NOT_READY = Finding(
    severity=Severity.NOTE, cause=Cause.NOT_READY, text="it carries out plan 'go'", remedy="Stop that plan"
)


def diagnosis(name: str, *findings: Finding) -> VehicleDiagnosis:
    return VehicleDiagnosis(
        name=name, imc_id=0x1E, state=NodeState.READY, healthy=False, causes=[], findings=list(findings), history=[]
    )


async def checks_of(
    service: MissionService, monkeypatch: pytest.MonkeyPatch, kind: VehicleKind, *findings: Finding, reason: str = ""
) -> list[CheckView]:
    live = await service.get((await service.create(sim_spec("a", side_m=60.0))).id)
    (member,) = live.team
    monkeypatch.setattr(member, "spec", member.spec.model_copy(update={"kind": kind}))
    info = VehicleInfo("a", kind.value, LinkState.HEARD if reason else LinkState.READY, reason=reason)
    monkeypatch.setattr(live.hub, "info", lambda _key: info)
    view = preflight(live, diagnosed=[diagnosis("stranger", NO_SOUNDINGS), diagnosis("a", *findings)])
    return [check for check in view.checks if check.id.startswith("doctor.")]


async def test_it_warns_of_what_the_doctor_advises_on_and_bars_no_start(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    checks = await checks_of(service, monkeypatch, VehicleKind.IMC, HEALTHY, NO_SOUNDINGS, NO_WAY_HOME, *REFUSED)
    assert [(check.id, check.status, check.message, check.remedy) for check in checks] == [
        ("doctor.a.no_soundings", CheckStatus.WARNING, "no Distance", "Switch on the altimeter"),
        ("doctor.a.no_way_home", CheckStatus.WARNING, "LostComms is not enabled", "Enable it"),
        ("doctor.a.soundings_refused", CheckStatus.NOTE, "3 Distances refused; 5 Distances refused", ""),
    ]
    assert {check.title for check in checks} == {"Doctor on a"}


async def test_what_the_link_says_already_is_not_said_twice(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    checks = await checks_of(
        service, monkeypatch, VehicleKind.IMC, NOT_READY, NO_WAY_HOME, reason="it carries out plan 'go'"
    )
    assert [check.id for check in checks] == ["doctor.a.no_way_home"]


async def test_nothing_is_said_of_a_namesake_of_another_kind(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert await checks_of(service, monkeypatch, VehicleKind.REST, NO_SOUNDINGS) == []
