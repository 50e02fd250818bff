"""Where the own ship is, by what her instruments say."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.missions.traffic.own_ship import OLD_S, OwnShip
from app.missions.traffic.sentences import SentenceError, ShipPosition
from tests.support.missions.ais import nmea

RMC = "GNRMC,092750.000,A,4111.1000,N,00842.3000,W,4.0,031.66,280511,,,A"
GGA = "GPGGA,092750.000,4111.1000,N,00842.3000,W,1,8,1.03,61.7,M,55.2,M,,"


def told(*sentences: str, now_s: float = 5.0) -> OwnShip:
    ship = OwnShip(forget_s=600.0)
    for sentence in sentences:
        assert ship.read(nmea(sentence), "GPS", now_s)
    return ship


def test_position_course_and_heading_are_put_together() -> None:
    found = told(GGA, "GPVTG,054.7,T,034.4,M,005.5,N,010.2,K,A", "HEHDT,123.4,T").at(6.0)
    assert found is not None
    assert (found.lat_deg, found.lon_deg) == pytest.approx((41.185, -8.705))
    assert (found.sog_mps, found.cog_deg, found.heading_deg) == pytest.approx((5.5 * 1852 / 3600, 54.7, 123.4))
    assert (found.source, found.heard_s) == ("GPS", 5.0)
    alone = told(RMC).at(5.0)
    assert alone is not None
    assert (alone.sog_mps, alone.cog_deg, alone.heading_deg) == (pytest.approx(4.0 * 1852 / 3600), 31.66, None)


@pytest.mark.parametrize(
    "sentence",
    [
        RMC.replace(",A,4111", ",V,4111"),
        GGA.replace(",W,1,", ",W,0,"),
        GGA.replace(",W,1,", ",W,6,"),
        "GPGGA,,,,,,0,,,,,,,,",
    ],
)
def test_what_is_no_fix_tells_no_place(sentence: str) -> None:
    assert told(sentence).at(5.0) is None


def test_what_was_told_long_ago_is_not_known() -> None:
    ship = told("HEHDT,123.4,T", now_s=0.0)
    ship.read(nmea(GGA), "GPS", OLD_S + 1.0)
    found = ship.at(OLD_S + 1.0)
    assert found is not None
    assert found.heading_deg is None
    assert ship.at(OLD_S + 602.0) is None


def test_her_transponder_counts() -> None:
    ship = OwnShip(600.0)
    ship.place(ShipPosition(211000001, True, 41.0, -8.0, 1.0, 90.0, 95.0), "AIS", 3.0)
    found = ship.at(3.0)
    assert found is not None
    assert (found.lat_deg, found.cog_deg, found.heading_deg, found.source) == (41.0, 90.0, 95.0, "AIS")


@pytest.mark.parametrize("line", [nmea(GGA)[:-2] + b"00", nmea(GGA).replace(b"4111", b"9911"), b"$GPGGA,092750"])
def test_damaged_lines_are_refused(line: bytes) -> None:
    ship = OwnShip(600.0)
    with pytest.raises(SentenceError):
        ship.read(line, "GPS", 0.0)
    assert ship.at(0.0) is None


def test_sentences_of_others_are_left_alone() -> None:
    assert not OwnShip(600.0).read(b"!AIVDM,1,1,,B,15NG6V0P01G?cFhE`R2IU?wn28R>,0*05", "GPS", 0.0)
    assert not OwnShip(600.0).read(nmea("SDDBT,10.0,f,3.0,M,1.6,F"), "GPS", 0.0)
    assert OwnShip(600.0).read(b"\\s:GP0001*27\\" + nmea(GGA), "GPS", 0.0)


@given(st.binary(max_size=120))
def test_nothing_that_is_sent_breaks_it(line: bytes) -> None:
    ship = OwnShip(600.0)
    for given_line in (line, b"$GPGGA," + line, b"$GPRMC," + line, b"$HEHDT," + line + b"*00"):
        try:
            ship.read(given_line, "GPS", 0.0)
        except SentenceError:
            continue
