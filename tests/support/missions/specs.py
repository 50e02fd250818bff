"""Small missions near Leixões, and their parts."""

from typing import Any

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.spec.mission import MissionSpec

LAT, LON = 41.185, -8.705
FRAME = LocalFrame(LAT, LON)
AREA: dict[str, Any] = {
    "type": "Polygon",
    "coordinates": [[[-8.705, 41.185], [-8.7043, 41.185], [-8.7043, 41.1855], [-8.705, 41.1855], [-8.705, 41.185]]],
}
"""59 m by 56 m in the harbour of Leixoes."""


def rectangle(west_m: float, south_m: float, east_m: float, north_m: float) -> dict[str, Any]:
    """A GeoJSON rectangle in metres from the corner (LAT, LON)."""
    corners = [(west_m, south_m), (east_m, south_m), (east_m, north_m), (west_m, north_m), (west_m, south_m)]
    return {"type": "Polygon", "coordinates": [[list(lon_lat(east, north)) for east, north in corners]]}


def lon_lat(east_m: float, north_m: float) -> tuple[float, float]:
    """Longitude and latitude of a place in metres from the corner (LAT, LON)."""
    lat, lon = FRAME.to_geographic(east_m, north_m)
    return float(lon), float(lat)


def spec_json(side_m: float = 30.0, **changes: Any) -> dict[str, Any]:
    values: dict[str, Any] = {
        "name": "Quay",
        "area": rectangle(0, 0, side_m, side_m),
        "vehicles": [{"name": "a", "kind": "rest"}, {"name": "b", "kind": "rest"}],
        "steps": 4,
        "cell_m": 2.0,
        "limits": {"max_step_m": 8.0},
        "planner": {"name": "random"},
    }
    if "budget" in changes:
        del values["steps"]
    return values | changes


def make_spec(side_m: float = 30.0, **changes: Any) -> MissionSpec:
    return MissionSpec.model_validate(spec_json(side_m, **changes))
