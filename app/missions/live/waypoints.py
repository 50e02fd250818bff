"""The newest waypoint of each vehicle of a mission, as everyone who watches sees it."""

from collections.abc import Sequence

from app.missions.fleet.interface import WaypointReport, WaypointStatus
from app.missions.live.broadcast import Broadcaster
from app.missions.spec.mission import MissionSpec
from app.missions.views.messages import WaypointsMessage
from app.missions.views.mission import WaypointView
from app.storage.models import WaypointRow


class WaypointViews:
    """Shows where vehicles were sent last and what became of it."""

    def __init__(self, spec: MissionSpec, broadcaster: Broadcaster) -> None:
        self._spec = spec
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

    def take(self, report: WaypointReport) -> None:
        """Show what a vehicle told of its waypoint, if that is still its newest."""
        shown = self._newest.get(report.vehicle)
        if shown is not None and shown.step == report.step:
            self._show([shown.model_copy(update={"status": report.status, "reason": report.reason})])

    def view(self, row: WaypointRow) -> WaypointView:
        """Return a stored waypoint as it is shown."""
        return WaypointView.model_validate(
            {
                "vehicle": row.vehicle,
                "step": row.step,
                "lat_deg": row.lat_deg,
                "lon_deg": row.lon_deg,
                "east_m": row.east_m,
                "north_m": row.north_m,
                "depth_m": row.depth_m,
                "speed_mps": self._spec.speed_mps,
                "arrival_radius_m": self._spec.arrival_radius_m,
                "min_altitude_m": self._spec.limits.min_altitude_m,
                "status": row.status,
                "reason": row.reason,
            }
        )

    def _show(self, waypoints: list[WaypointView]) -> None:
        if waypoints:
            self._newest |= {waypoint.vehicle: waypoint for waypoint in waypoints}
            self._broadcaster.publish(WaypointsMessage(waypoints=waypoints))
