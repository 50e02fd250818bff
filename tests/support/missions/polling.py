"""A vehicle that polls, as simple as one made of curl calls: it posts what it sounds and goes where it is told."""

import asyncio
import math
import uuid
from dataclasses import dataclass, field

import httpx
import numpy as np

from app.mapping.coordinates.georeference import LocalFrame

RETRY_S = 0.05
SOUNDING_SPACING_M = 2.0


@dataclass
class PollingVehicle:
    """Keeps trying whatever happens to the service; a batch is repeated with its key until it was answered."""

    name: str
    frame: LocalFrame
    east_m: float
    north_m: float
    stride_m: float = 20.0
    time_s: float = 1_795_225_140.0
    steps_seen: list[int] = field(default_factory=list)
    accepted: list[float] = field(default_factory=list)
    told_to_stop: bool = False
    waits: bool = False
    """Stays where it is and asks for nothing."""
    waits_after_step: int | None = None
    """Does so once it has flown this step."""
    gives_up: bool = False
    """Asks for its waypoint, too, while its batch is not taken, and forgets the batch."""
    asks: bool = False
    """Waits for an answer with its waypoint."""

    def depth_here_m(self) -> float:
        return 10.0 + 2.0 * math.sin(self.east_m / 15.0) + 0.05 * self.north_m

    def measurement(self) -> dict[str, object]:
        self.time_s += 1.0
        lat, lon = self.frame.to_geographic(np.array(self.east_m), np.array(self.north_m))
        return {
            "vehicle": self.name,
            "time_s": self.time_s,
            "lat_deg": float(lat),
            "lon_deg": float(lon),
            "depth_m": 2.0,
            "range_m": self.depth_here_m() - 2.0,
        }

    async def post(self, api: httpx.AsyncClient, mission_id: str, items: list[dict[str, object]]) -> None:
        headers = {"Idempotency-Key": str(uuid.uuid4())}
        while True:
            try:
                answer = await api.post(f"/missions/{mission_id}/measurements", json={"items": items}, headers=headers)
            except httpx.TransportError:
                await asyncio.sleep(RETRY_S)
                continue
            if answer.status_code == httpx.codes.SERVICE_UNAVAILABLE:
                if self.gives_up:
                    return
                await asyncio.sleep(RETRY_S)
                continue
            assert answer.status_code == httpx.codes.OK, answer.text
            verdicts = answer.json()["items"]
            self.accepted += [
                item["time_s"]  # type: ignore[misc]
                for item, verdict in zip(items, verdicts, strict=True)
                if verdict["verdict"] == "accepted"
            ]
            return

    async def next_waypoint(self, api: httpx.AsyncClient, mission_id: str) -> dict[str, float] | None:
        """Return a waypoint newer than the last; None when there is none yet, or none ever again."""
        after = {"after_step": self.steps_seen[-1]} if self.steps_seen else {}
        self.asks = True
        try:
            answer = await api.get(
                f"/missions/{mission_id}/vehicles/{self.name}/waypoint", params={**after, "timeout_s": 2}
            )
        except httpx.TransportError:
            await asyncio.sleep(RETRY_S)
            return None
        finally:
            self.asks = False
        if answer.status_code == httpx.codes.CONFLICT:
            self.told_to_stop = True
            return None
        if answer.status_code != httpx.codes.OK:
            return None
        waypoint: dict[str, float] = answer.json()
        self.steps_seen.append(int(waypoint["step"]))
        return waypoint

    async def travel(self, api: httpx.AsyncClient, mission_id: str, waypoint: dict[str, float]) -> None:
        """Go there in strides, sounding on the way, and report."""
        items = []
        while (left_m := math.hypot(waypoint["east_m"] - self.east_m, waypoint["north_m"] - self.north_m)) > 0.1:
            part = min(SOUNDING_SPACING_M, left_m) / left_m
            self.east_m += part * (waypoint["east_m"] - self.east_m)
            self.north_m += part * (waypoint["north_m"] - self.north_m)
            items.append(self.measurement())
        await self.post(api, mission_id, items or [self.measurement()])

    def _waits_after_its_step(self) -> bool:
        last = self.waits_after_step
        return last is not None and bool(self.steps_seen) and self.steps_seen[-1] >= last

    async def run(self, api: httpx.AsyncClient, mission_id: str) -> None:
        """Take part until told to stop."""
        await self.post(api, mission_id, [self.measurement()])
        while not self.told_to_stop:
            while self.waits or self._waits_after_its_step():  # noqa: ASYNC110 - whoever set it takes it back
                await asyncio.sleep(RETRY_S)
            waypoint = await self.next_waypoint(api, mission_id)
            if waypoint is not None:
                await self.travel(api, mission_id, waypoint)
            elif not self.told_to_stop:
                # After a restart the service knows where a vehicle is only when it says so.
                await self.post(api, mission_id, [self.measurement()])
