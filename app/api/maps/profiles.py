"""A mission's map along a line."""

from typing import Annotated

from fastapi import APIRouter, Query

from app.api.access.auth import Reader
from app.api.http.problems import problems
from app.api.maps.maps import JSON_LAYERS, OneOf, S44Order, layer_of
from app.api.mission import Mission
from app.api.schemas import API
from app.api.state import Service
from app.mapping.layers import Layer
from app.mapping.s44 import Order
from app.missions.errors import InvalidRequestError
from app.missions.operations.maps.mission_maps import newest_map
from app.missions.operations.maps.profile import ProfileRequest, profile_of
from app.missions.views.maps.profile import ProfileView

router = APIRouter(
    prefix=f"{API}/missions/{{mission_id}}",
    tags=["maps"],
    responses=problems("unauthenticated", "forbidden", "mission-not-found", "map-not-ready", "invalid-request"),
)

MOST_M = 1000.0
"""Between two points, and from the line to its soundings."""

FEWEST_CORNERS, MOST_CORNERS = 2, 100
_Metres = Annotated[float | None, Query(gt=0, le=MOST_M, allow_inf_nan=False)]


@router.get("/profile", operation_id="getProfile", summary="See the map along a line")
async def get_profile(
    service: Service,
    reader: Reader,
    mission: Mission,
    line: Annotated[
        str,
        Query(
            max_length=4000,
            pattern=r"^[-+.,;0-9]+$",
            description="Its 2 to 100 corners as longitude,latitude, with ; between them",
            examples=["-8.7049,41.1851;-8.7041,41.1856"],
        ),
    ],
    spacing_m: Annotated[_Metres, Query(description="Between points; default: half a cell")] = None,
    within_m: Annotated[_Metres, Query(description="From the line to soundings at most; default: one cell")] = None,
    layer: Annotated[
        list[Annotated[str, OneOf(JSON_LAYERS)]] | None,
        Query(max_length=len(JSON_LAYERS), description="Further layers, in `layers`; repeat it for several"),
    ] = None,
    order: S44Order = Order.ORDER_1A,
) -> ProfileView:
    """Return depth and deviation of the newest map along a line, and the accepted soundings beside it.

    Depths are interpolated between cells; the deviation of a point is the largest of the cells that it lies between.
    """
    corners = _corners(line)
    snapshot = await newest_map(mission, service.maps, patient=False)
    names = sorted(set(layer or ()))

    def layers() -> list[Layer]:
        return [layer_of(snapshot, name, order) for name in names]

    return await profile_of(mission, snapshot, ProfileRequest(corners, spacing_m, within_m), layers)


def _corners(line: str) -> list[tuple[float, float]]:
    """Return longitude and latitude of a line's corners. Raises InvalidRequestError where one is no place on Earth."""
    texts = line.split(";")
    if not FEWEST_CORNERS <= len(texts) <= MOST_CORNERS:
        raise _no_line(f"the line has {len(texts)} corner(s), not {FEWEST_CORNERS} to {MOST_CORNERS}")
    corners = []
    for i, text in enumerate(texts, start=1):
        try:
            lon_deg, lat_deg = map(float, text.split(","))
        except ValueError:
            raise _no_line(f"corner {i} of the line is '{text[:40]}': no longitude,latitude") from None
        if abs(lon_deg) > 180.0 or abs(lat_deg) > 90.0:
            raise _no_line(f"corner {i} of the line is {text[:40]}: no longitude within ±180 and latitude within ±90")
        corners.append((lon_deg, lat_deg))
    return corners


def _no_line(why: str) -> InvalidRequestError:
    return InvalidRequestError("line", why, "Give each corner as longitude,latitude, with ; between them")
