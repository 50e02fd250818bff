"""A mission of the whole service over vehicles that cannot be reached under water."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from pydantic import ValidationError

from app.missions.operations.history import events_after
from app.missions.operations.imports.log_import import import_log
from app.missions.settings import ImcSettings, ServiceSettings
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleSpec
from app.missions.states import MissionState
from imc_bridge import NodeState, Sounding
from imc_bridge.logs import VehicleLog
from tests.support.imc.sea import open_sea
from tests.support.missions.harbour import Harbour, act, view_of
from tests.support.missions.stored_soundings import soundings_of
from tests.support.waiting import until

SPEED = 20.0


@pytest.mark.slow
async def test_a_mission_by_legs_finishes_without_contact_under_water_and_has_every_sounding_in_the_end(
    make_settings: Callable[..., ServiceSettings], tmp_path: Path
) -> None:
    async with open_sea(radio_range_m=2000.0, connected=False, speed=SPEED, log_dir=tmp_path / "logs") as sea:
        imc = ImcSettings(
            port=sea.settings.port,
            announce_ports=sea.settings.announce_ports,
            loopback_only=True,
            unknown_bottom_depth_m=2.5,
        )
        harbour = Harbour(make_settings)
        service = await harbour.open(imc=imc, time_scale=SPEED)
        await sea.launch()
        try:
            name = sea.fleet.nodes[0].name
            corners = [sea.floor.frame.to_geodetic(*place) for place in ((5, 5), (95, 5), (95, 95), (5, 95), (5, 5))]
            spec = MissionSpec.model_validate(
                {
                    "name": "By legs",
                    "area": {"type": "Polygon", "coordinates": [[[lon, lat] for lat, lon in corners]]},
                    "vehicles": [{"name": name, "guidance": "legs"}],
                    "steps": 2,
                    "cell_m": 5.0,
                    "limits": {"max_step_m": 25.0, "min_depth_m": 2.0, "max_depth_m": 2.0},
                    "planner": {"name": "random"},
                    # Legs take longer: that is seen to.
                    "step_deadline_s": 5.0,
                }
            )
            mission = await service.create(spec)

            async def ready() -> bool:
                return any(v.name == name and v.link == "ready" for v in await service.vehicles())

            await until(ready, "the vehicle is ready")
            await act(service, mission.id, "start", actor="tester")

            async def ended() -> bool:
                view = await view_of(service, mission.id)
                return view.state in (MissionState.FINISHED, MissionState.FAILED)

            await until(ended, "the mission has ended")
            view = await view_of(service, mission.id)
            assert view.state is MissionState.FINISHED, view.reason
            assert view.progress.step == 2
            assert {str(waypoint.status) for waypoint in view.waypoints} == {"reached"}
            [examined] = service.doctor().vehicles
            links = {record.state for record in examined.history}
            assert NodeState.EXPECTED_OFFLINE in links, "silence under water is part of the plan"
            assert NodeState.LOST not in links
            warnings = [e.message for e in await events_after(await service.get(mission.id)) if e.level != "info"]
            assert not [message for message in warnings if "straggler" in message or "goes on without" in message]
            by_radio = await soundings_of(await service.get(mission.id))
            await sea.vanish()
            [log] = list_logs(tmp_path)
            imported = await import_log(await service.get(mission.id), service.settings, log, actor="tester")
            measured = [event for event in VehicleLog(log, sea.settings).events() if isinstance(event, Sounding)]
            accepted = {s.time_s for s in await soundings_of(await service.get(mission.id)) if s.verdict == "accepted"}
            assert len(by_radio) < 0.7 * len(measured), "radio carried only what was measured at the surface"
            assert imported.duplicate > 0, "which the log holds as well"
            assert accepted >= {event.time_s for event in measured}, "nothing that was measured is missing"
        finally:
            await harbour.close()
            await asyncio.sleep(0)


def list_logs(folder: Path) -> list[Path]:
    """The logs that the vehicles kept on board."""
    return sorted(folder.glob("logs/*/*/Data.lsf"))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "rest", "guidance": "legs"}, "only vehicles of kind imc"),
        ({"guidance": "acoustic"}, "a gateway is named with guidance acoustic"),
        ({"guidance": "legs", "gateway": "manta-1"}, "a gateway is named with guidance acoustic"),
        ({"guidance": "sonar"}, "guidance"),
    ],
)
def test_how_a_vehicle_is_led_has_to_make_sense(changes: dict[str, str], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        VehicleSpec.model_validate({"name": "a"} | changes)


def test_a_vehicle_led_by_sound_names_its_gateway() -> None:
    spec = VehicleSpec.model_validate({"name": "a", "guidance": "acoustic", "gateway": "manta-1"})
    assert VehicleSpec.model_validate(spec.model_dump(mode="json")) == spec
