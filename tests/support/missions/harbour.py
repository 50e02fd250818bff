"""A service on a file, vehicles that poll it, and ways to wait."""

import asyncio
import contextlib
import itertools
from collections.abc import Callable
from typing import Any

from app.missions.errors import ConflictError, VehicleNotFoundError
from app.missions.operations.measurements import measure
from app.missions.operations.polling import waypoint
from app.missions.running.mission_views import mission_view
from app.missions.service import MissionService
from app.missions.settings import ServiceSettings
from app.missions.soundings.measurement import Measurement
from app.missions.spec.mission import MissionSpec
from app.missions.states import Action, MissionState
from app.missions.views.mission import ActionView, MissionView
from app.storage.database import Database
from tests.support.missions.specs import lon_lat, spec_json
from tests.support.waiting import until

CLOCK_S = 1_795_225_140.0


class Harbour:
    """The service in this process."""

    def __init__(self, make_settings: Callable[..., ServiceSettings]) -> None:
        self._make_settings = make_settings
        self._open = False

    async def open(self, **changes: Any) -> MissionService:
        settings = self._make_settings(**changes)
        self.database = Database(settings.database_url)
        self.service = MissionService(settings, self.database)
        await self.service.startup()
        self._open = True
        return self.service

    async def close(self) -> None:
        if self._open:
            self._open = False
            await self.service.shutdown()
            await self.database.close()

    async def reopen(self, **changes: Any) -> MissionService:
        await self.close()
        return await self.open(**changes)


def sim_spec(*names: str, **changes: Any) -> MissionSpec:
    vehicles = [{"name": name, "kind": "sim"} for name in names or ("a", "b")]
    return MissionSpec.model_validate(spec_json(**({"vehicles": vehicles} | changes)))


async def view_of(service: MissionService, mission_id: str) -> MissionView:
    return mission_view(await service.get(mission_id))


async def act(
    service: MissionService, mission_id: str, action: str, *, actor: str = "Ana", note: str = ""
) -> ActionView:
    return await service.act(await service.get(mission_id), Action(action), actor=actor, note=note)


async def state_of(service: MissionService, mission_id: str) -> MissionState:
    return (await view_of(service, mission_id)).state


async def until_state(service: MissionService, mission_id: str, state: MissionState) -> MissionView:
    async def there() -> bool:
        now = await state_of(service, mission_id)
        ended = now in (MissionState.FAILED, MissionState.ABORTED, MissionState.FINISHED)
        assert now is state or not ended, (now, (await view_of(service, mission_id)).reason)
        return now is state

    await until(there, f"the mission is {state}")
    return await view_of(service, mission_id)


async def until_step(service: MissionService, mission_id: str, step: int) -> None:
    async def there() -> bool:
        view = await view_of(service, mission_id)
        assert view.state is not MissionState.FAILED, view.reason
        return view.progress.step >= step

    await until(there, f"step {step} is committed")


class Rover:
    """A vehicle that polls: posts where it is with a sounding, fetches its waypoint, and is there at once."""

    def __init__(
        self, service: MissionService, mission_id: str, name: str, east_m: float = 5, north_m: float = 5
    ) -> None:
        self.service = service
        self.mission_id = mission_id
        self.name = name
        self.steps: list[int] = []
        self.told: list[str] = []
        self._clock = itertools.count(CLOCK_S)
        self._lon, self._lat = lon_lat(east_m, north_m)
        self._task: asyncio.Task[None] | None = None

    def item(self, **changes: Any) -> Measurement:
        values = {
            "vehicle": self.name,
            "time_s": next(self._clock),
            "lat_deg": self._lat,
            "lon_deg": self._lon,
            "depth_m": 2.0,
            "range_m": 8.0,
        }
        return Measurement.model_validate(values | changes)

    async def post(self, **changes: Any) -> None:
        await measure(await self.service.get(self.mission_id), [self.item(**changes)])

    async def poll(self, timeout_s: float = 1.0) -> bool:
        """One round; whether a waypoint came."""
        after = self.steps[-1] if self.steps else None
        found = await waypoint(
            await self.service.get(self.mission_id), self.name, after_step=after, timeout_s=timeout_s
        )
        if found is None:
            return False
        self.steps.append(found.step)
        self._lat, self._lon = found.lat_deg, found.lon_deg
        await self.post()
        return True

    async def sail(self) -> None:
        """Follow until told to stop for good."""
        await self.post()
        while True:
            try:
                await self.poll()
            except VehicleNotFoundError as refusal:
                self.told.append(str(refusal))
                return
            except ConflictError as refusal:
                self.told.append(str(refusal))
                if "paused" not in str(refusal):
                    return
                await asyncio.sleep(0.02)

    async def __aenter__(self) -> "Rover":
        self._task = asyncio.create_task(self.sail())
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._task is None:
            return
        if not self._task.done():
            self._task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await self._task
