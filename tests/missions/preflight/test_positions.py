"""What the checklist says of how old and how sure positions are."""

from dataclasses import replace

import pytest

from app.missions.fleet.interface import LinkCapabilities, LinkState, Position, VehicleInfo, VehicleReport
from app.missions.preflight.survey import preflight
from app.missions.service import MissionService
from app.missions.spec.surface_policy import SurfacePolicy
from app.missions.views.mission import CheckView
from tests.support.missions.harbour import sim_spec
from tests.support.missions.specs import LAT, LON

HEARD = VehicleInfo(
    "a", "imc", LinkState.READY, age_s=1.0, report=VehicleReport("a", 1.8e9, Position(LAT, LON, 0.0), position_sd_m=1.5)
)


def told(age_s: float | None, sd_m: float | None) -> VehicleInfo:
    assert HEARD.report is not None
    return replace(HEARD, position_age_s=age_s, report=replace(HEARD.report, position_sd_m=sd_m))


async def checks(
    service: MissionService,
    monkeypatch: pytest.MonkeyPatch,
    info: VehicleInfo,
    policy: SurfacePolicy | None = None,
    *,
    simulated: bool = False,
) -> list[CheckView]:
    spec = sim_spec("a", side_m=60.0).model_copy(update={"surface_policy": policy})
    live = await service.get((await service.create(spec)).id)
    (member,) = live.team
    monkeypatch.setattr(member, "capabilities", LinkCapabilities(simulated=simulated))
    monkeypatch.setattr(live.hub, "info", lambda _key: info)
    return [check for check in preflight(live).checks if check.id.startswith("position.")]


@pytest.mark.parametrize(
    ("info", "status", "message", "remedy"),
    [
        (told(2.0, 1.5), "ok", "told 2 s ago, known to ±1.5 m", ""),
        (told(None, None), "ok", "told 1 s ago, how well it is known is not told", ""),
        (told(600.0, 1.5), "warning", "told 10 min ago, known to ±1.5 m", "Let it tell where it is"),
        (told(2.0, 25.0), "warning", "told 2 s ago, known to ±25.0 m", "at most ±10 m is good"),
    ],
    ids=["fresh", "untold", "old", "vague"],
)
async def test_it_warns_of_positions_that_are_old_or_vague(
    service: MissionService,
    monkeypatch: pytest.MonkeyPatch,
    info: VehicleInfo,
    status: str,
    message: str,
    remedy: str,
) -> None:
    [check] = await checks(service, monkeypatch, info)
    assert (check.status, check.message) == (status, message)
    assert remedy in check.remedy
    assert bool(check.remedy) == bool(remedy)


async def test_the_surface_policy_says_how_sure_is_enough(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    [check] = await checks(service, monkeypatch, told(2.0, 4.0), SurfacePolicy(max_position_sd_m=3.0))
    assert check.status == "warning"
    assert "at most ±3 m" in check.remedy


async def test_nothing_is_said_of_who_has_told_nothing_or_is_simulated(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert await checks(service, monkeypatch, replace(HEARD, report=None)) == []
    assert await checks(service, monkeypatch, told(600.0, 99.0), simulated=True) == []
