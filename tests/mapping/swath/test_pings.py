"""How far pings reach."""

import numpy as np

from app.mapping.swath.pings import Pings, reach_m


def pings(angles_deg: list[list[float]], ranges_m: list[list[float]], roll_deg: float = 0.0) -> Pings:
    n = len(angles_deg)
    still = np.zeros(n)
    angles = np.radians(np.array(angles_deg)).astype(np.float32)
    roll = np.full(n, np.radians(roll_deg))
    return Pings(still, still, still, still, roll, still, still, still, angles, np.array(ranges_m, np.float32))


def test_a_ping_reaches_as_far_as_its_outermost_beams_that_met_something() -> None:
    found = reach_m(pings([[-60.0, 0.0, 30.0], [-60.0, 0.0, 30.0]], [[10.0, 6.0, 8.0], [np.nan, 6.0, 8.0]]))
    np.testing.assert_allclose(found, [[10.0 * np.sin(np.radians(60)), 4.0], [0.0, 4.0]], rtol=1e-6)


def test_roll_with_starboard_down_brings_the_swath_to_port() -> None:
    found = reach_m(pings([[-45.0, 45.0]], [[10.0, 10.0]], roll_deg=15.0))
    np.testing.assert_allclose(found, 10.0 * np.sin(np.radians([[60.0, 30.0]])), rtol=1e-6)


def test_a_ping_that_met_nothing_has_no_reach() -> None:
    assert np.isnan(reach_m(pings([[-45.0, 45.0]], [[np.nan, np.nan]]))).all()
