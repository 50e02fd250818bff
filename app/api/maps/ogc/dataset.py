"""Missions that programs read together: all of them, or one."""

from collections.abc import Sequence
from dataclasses import dataclass

from starlette.requests import Request

from app.api.http.links import link_root
from app.api.maps.ogc.crs import common_zone, offered
from app.api.schemas import is_mission_id
from app.api.state import EdgeState
from app.missions.errors import MissionNotFoundError
from app.storage.models import MissionRow


@dataclass(frozen=True)
class Dataset:
    """Missions, oldest first, the address that leads to them, and whether that is the one of a single mission."""

    rows: Sequence[MissionRow]
    root: str
    title: str
    single: bool = False

    @property
    def crs(self) -> list[str]:
        """Return the systems that its features can be had in."""
        return offered(self._rings)

    @property
    def zone(self) -> list[int]:
        """Return the EPSG code of the UTM zone that all lie in; none where that is more than one."""
        return common_zone(self._rings)

    @property
    def _rings(self) -> list[list[tuple[float, float]]]:
        return [row.spec["area"]["coordinates"][0][:-1] for row in self.rows]


async def dataset_of(request: Request, edge: EdgeState, prefix: str) -> Dataset:
    """Return the missions that an address below ``prefix`` is about. Raises MissionNotFoundError."""
    mission_id = request.path_params.get("mission_id")
    root = f"{link_root(request)}{prefix}"
    if mission_id is None:
        return Dataset(await edge.service.rows(), root, "Missions")
    rows = await edge.service.rows(mission_id) if is_mission_id(mission_id) else []
    if not rows:
        raise MissionNotFoundError(f"there is no mission {mission_id[:64]!r}", "GET /api/v1/missions lists all")
    return Dataset(rows, f"{root}/missions/{rows[0].id}", rows[0].name, single=True)
