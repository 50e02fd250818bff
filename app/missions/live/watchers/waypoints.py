"""The newest waypoint of each vehicle of a mission, as everyone who watches sees it."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from app.missions.fleet.interface import Position, WaypointReport, WaypointStatus
from app.missions.live.watchers.broadcast import Broadcaster
from app.missions.spec.mission import MissionSpec
from app.missions.team import Team
from app.missions.views.messages import WaypointsMessage
from app.missions.views.mission import WaypointView
from app.storage.models import WaypointRow


class WaypointViews:
    """Shows where vehicles were sent last and what became of it."""

    def __init__(self, spec: Callable[[], MissionSpec], team: Team, broadcaster: Broadcaster) -> None:
        self._spec = spec
        self._team = team
        self._broadcaster = broadcaster
        self._newest: dict[str, WaypointView] = {}

    @property
    def newest(self) -> list[WaypointView]:
        """The newest waypoint of each vehicle."""
        return list(self._newest.values())

    def of(self, vehicle: str) -> WaypointView | None:
        """Return a vehicle's newest waypoint."""
        return self._newest.get(vehicle)

    def show_rows(self, rows: Sequence[WaypointRow], status: WaypointStatus | None = None) -> None:
        """Make stored waypoints the vehicles' newest; with another status than the stored one, if it is given."""
        views = [self.view(row) for row in rows]
        self._show(views if status is None else [view.model_copy(update={"status": status}) for view in views])

    def show(self, step: int, vehicle: str, place: Position, en_m: NDArray[np.float64]) -> None:
        """Make a leg that a vehicle begins its newest waypoint."""
        planned = WaypointStatus.PLANNED
        self._show([self._view(vehicle, step, place, (float(en_m[0]), float(en_m[1])), planned, "")])

    def take(self, report: WaypointReport) -> None:
        """Show what a vehicle told of its waypoint, if that is still its newest."""
        shown = self._newest.get(report.vehicle)
        if shown is not None and shown.step == report.step:
            self._show([shown.model_copy(update={"status": report.status, "reason": report.reason})])

    def view(self, row: WaypointRow) -> WaypointView:
        """Return a stored waypoint as it is shown."""
        place = Position(row.lat_deg, row.lon_deg, row.depth_m)
        return self._view(row.vehicle, row.step, place, (row.east_m, row.north_m), row.status, row.reason)

    def _view(
        self, vehicle: str, step: int, place: Position, en_m: tuple[float, float], status: str, reason: str
    ) -> WaypointView:
        member = self._team.get(vehicle) or self._team.departed.get(vehicle)
        return WaypointView.model_validate(
            {
                "vehicle": vehicle,
                "step": step,
                "lat_deg": place.lat_deg,
                "lon_deg": place.lon_deg,
                "east_m": en_m[0],
                "north_m": en_m[1],
                "depth_m": place.depth_m,
                "speed_mps": self._spec().speed_of(vehicle if member is None else member.spec),
                "arrival_radius_m": self._spec().arrival_radius_m,
                "min_altitude_m": self._spec().limits.min_altitude_m,
                "status": status,
                "reason": reason,
            }
        )

    def _show(self, waypoints: list[WaypointView]) -> None:
        if waypoints:
            self._newest |= {waypoint.vehicle: waypoint for waypoint in waypoints}
            self._broadcaster.publish(WaypointsMessage(waypoints=waypoints))
