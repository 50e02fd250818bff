"""Where a vehicle is sent for a waypoint that it may pass on the way to a point beyond it."""

from hypothesis import example, given
from hypothesis import strategies as st

from imc_bridge import Waypoint
from imc_bridge.control.orders import Order
from imc_bridge.control.references import SentReference
from imc_bridge.distances import Place
from imc_bridge.events import StateReport
from simulator.geodesy import LocalFrame

FRAME = LocalFrame(41.185, -8.704)
METRES = st.floats(-60.0, 60.0)
DEPTH_TOLERANCE_M = 1.0


def report(place: Place) -> StateReport:
    return StateReport("a", 0.0, *place, depth_m=0.0, heading_rad=0.0, speed_mps=1.0)


@given(METRES, METRES, METRES, METRES)
@example(4.8, 1.4, 8.7, 23.4).via("a vehicle that gave way beside its waypoint flew on to the lead and waited there")
def test_who_is_led_beyond_a_waypoint_has_passed_it_when_it_is_there(
    start_east_m: float, start_north_m: float, lead_east_m: float, lead_north_m: float
) -> None:
    place, start, lead = (
        FRAME.to_geodetic(*en_m) for en_m in ((0.0, 0.0), (start_east_m, start_north_m), (lead_east_m, lead_north_m))
    )
    waypoint = Waypoint("test", 1, *place, 0.0, lead_lat_deg=lead[0], lead_lon_deg=lead[1])
    order = Order.made(waypoint, report(start))
    order.sent.append(SentReference(0.0, 0.0, 0.0, 1.0))
    there = report(lead)
    arrived = order.arrival(there, DEPTH_TOLERANCE_M, 0.0) is not None
    assert not order.leading or arrived or order.missed(there, DEPTH_TOLERANCE_M)
