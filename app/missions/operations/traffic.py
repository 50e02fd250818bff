"""Ships about all missions of this process."""

from collections.abc import Iterable

from app.missions.live.mission import LiveMission
from app.missions.states import ENDED
from app.missions.traffic.ship_list import Ship
from app.missions.traffic.watch import Traffic
from app.missions.views.traffic import ApproachView, TrafficView, own_ship_view, ship_view, source_views


def places_of(missions: Iterable[LiveMission]) -> list[tuple[float, float]]:
    """Return where missions are that have not ended, latitude and longitude."""
    return [(m.frame.origin_lat_deg, m.frame.origin_lon_deg) for m in missions if m.header.state not in ENDED]


def traffic_view(traffic: Traffic, missions: Iterable[LiveMission]) -> TrafficView:
    """Return the ships about, each with the vehicle of any mission under way that it comes closest to."""
    ships = traffic.ships()
    closest: dict[int, ApproachView] = {}
    for live in missions:
        if live.header.state in ENDED:
            continue
        for mmsi, approach in live.ships.closest(near(traffic, live)).items():
            if mmsi not in closest or approach.distance_m < closest[mmsi].distance_m:
                closest[mmsi] = approach
    return TrafficView(
        ships=[ship_view(ship, traffic, closest.get(ship.position.mmsi)) for ship in ships],
        own_ship=own_ship_view(traffic),
        sources=source_views(traffic),
        malformed=traffic.malformed,
        dropped=traffic.dropped,
        turned_away=traffic.ship_list.turned_away,
        jumps=traffic.ship_list.jumps,
    )


def near(traffic: Traffic, live: LiveMission) -> list[Ship]:
    """Return the ships near a mission."""
    return traffic.near(live.frame.origin_lat_deg, live.frame.origin_lon_deg)
