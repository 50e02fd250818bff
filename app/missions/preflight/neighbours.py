"""What there is to say of other missions that are flown in the same place."""

import math
from collections.abc import Iterator, Sequence

from shapely.affinity import scale
from shapely.geometry import Polygon

from app.mapping.coordinates.distances import METRES_PER_DEGREE
from app.missions.fleet.hub import called
from app.missions.live.mission import LiveMission
from app.missions.views.mission import CheckStatus, CheckView
from app.storage.models import MissionRow

BESIDE_M = 30.0
"""Vehicles turn, wait and drift so far beside their areas."""
Ring = Sequence[tuple[float, float]]


def neighbour_checks(live: LiveMission, at_sea: Sequence[MissionRow]) -> Iterator[CheckView]:
    """Return a line for each mission at sea that is flown where this one is, among some as they are stored.

    Legs of different missions are not decided apart, and not every vehicle can give way. Simulated ones are told of,
    too: what is tried out goes as it would at sea.
    """
    for row in at_sea:
        if row.id in (live.id, live.spec.after):
            continue
        if _apart_m(live.spec.area.ring, row.spec["area"]["coordinates"][0]) > BESIDE_M:
            continue
        yield CheckView(
            id=f"neighbour.{row.id}",
            title="Other mission",
            status=CheckStatus.WARNING,
            message=f"mission {called(row.name, row.id)} is {row.state} in the same place: vehicles of different "
            "missions are not planned apart, they only give way to each other when they are about to meet",
            remedy="Fly them one after the other, or all vehicles in one mission; else at depths that are far apart, "
            "with an eye on who comes up",
        )


def _apart_m(one: Ring, other: Ring) -> float:
    """Return about how far two areas are apart, metres; 0 where they overlap."""
    east_m = METRES_PER_DEGREE * math.cos(math.radians(one[0][1]))
    first, second = (scale(Polygon(ring), east_m, METRES_PER_DEGREE, origin=(0, 0, 0)) for ring in (one, other))
    return float(first.distance(second))
