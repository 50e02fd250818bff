"""Measurements of the HTTP edge and of the fleet, in Prometheus' text format. Missions keep their own."""

from collections.abc import Sequence

from prometheus_client import REGISTRY, CollectorRegistry, Counter, Gauge, Histogram, generate_latest

from app.missions.fleet.interface import LinkState
from app.missions.states import MissionState
from app.missions.views.mission import MissionSummary, VehicleView

REQUESTS = Counter(
    "bathyfleet_http_requests_total", "Requests by method, route and status", ["method", "route", "status"]
)
REQUEST_SECONDS = Histogram(
    "bathyfleet_http_request_seconds",
    "Time to answer a request, streams and long polls included",
    ["method", "route"],
    buckets=(0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0),
)
LIVE_VIEWERS = Gauge("bathyfleet_live_viewers", "Open live views and event streams", ["kind"])
for _kind in ("websocket", "sse"):
    LIVE_VIEWERS.labels(_kind)

CONNECTED = frozenset({LinkState.HEARD, LinkState.READY, LinkState.ENGAGED})


def observe_request(method: str, route: str, status: int, seconds: float) -> None:
    """Count one answered request; ``status`` 0 means that the client left before an answer."""
    REQUESTS.labels(method, route, str(status)).inc()
    REQUEST_SECONDS.labels(method, route).observe(seconds)


def exposition(missions: Sequence[MissionSummary], vehicles: Sequence[VehicleView]) -> bytes:
    """Return everything measured so far, with missions by state and vehicles by link as given."""
    now = CollectorRegistry()
    states = Gauge("bathyfleet_missions", "Missions by state", ["state"], registry=now)
    for state in MissionState:
        states.labels(state.value).set(sum(mission.state == state for mission in missions))
    links = Gauge("bathyfleet_vehicles", "Vehicles by state of their link", ["link"], registry=now)
    for link in LinkState:
        links.labels(link.value).set(sum(vehicle.link == link for vehicle in vehicles))
    connected = Gauge("bathyfleet_vehicles_connected", "Vehicles that are heard", registry=now)
    connected.set(sum(vehicle.link in CONNECTED for vehicle in vehicles))
    return generate_latest(REGISTRY) + generate_latest(now)
