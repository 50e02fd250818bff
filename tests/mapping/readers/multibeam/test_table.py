"""Soundings of swaths near a place: what is kept of files that are long, wide or elsewhere."""

import tracemalloc
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.georeferencing import place_reference, place_soundings
from app.mapping.readers.multibeam import table
from app.mapping.readers.multibeam.table import SwathTable
from app.mapping.readers.multibeam.types import FilePing
from app.mapping.readers.types import MapExtent, ReadError, ReadOptions
from app.mapping.types import Grid
from tests.support.mapping.multibeam import floor

FRAME = LocalFrame(41.1850, -8.7040)
PLACE = MapExtent(FRAME, Grid(-20.0, -20.0, 2.0, 20, 20), margin_m=5.0)
BEAMS = 400


def pings(count: int, frame: LocalFrame = FRAME, step_m: float = 0.01, sd_m: float = np.nan) -> Iterator[FilePing]:
    """Pings on a line to the north, over :func:`floor`."""
    starboard = np.linspace(-15.0, 15.0, BEAMS)
    no = np.zeros(BEAMS, bool)
    for number in range(count):
        north = step_m * (number - count / 2)
        lat, lon = frame.to_geographic(0.0, north)
        yield FilePing(
            number=number + 1,
            time_s=1.7e9 + number,
            lat_deg=float(lat),
            lon_deg=float(lon),
            heading_deg=0.0,
            sonar_depth_m=2.0,
            level_m=0.0,
            forward_m=np.zeros(BEAMS),
            starboard_m=starboard,
            depth_m=floor(starboard, north),
            sd_m=np.full(BEAMS, sd_m),
            detection_sd_m=np.full(BEAMS, 0.3),
            rejected=no,
            detected=~no,
        )


def filled(made: Iterator[FilePing], place: MapExtent = PLACE) -> SwathTable:
    found = SwathTable(place)
    for ping in made:
        found.add(ping)
    return found


def test_more_soundings_than_are_kept_become_means_of_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "BATCH_SOUNDINGS", 2000)
    whole = filled(pings(50, step_m=0.5, sd_m=0.3)).points([], 0)
    monkeypatch.setattr(table, "MAX_SOUNDINGS", 5000)
    means = filled(pings(50, step_m=0.5, sd_m=0.3)).points([], 0)
    assert (len(whole.z), whole.found, means.found) == (20_000, 20_000, 20_000)
    assert len(means.z) < 600
    np.testing.assert_allclose(means.z, floor(means.x, means.y), atol=1e-3)  # a plane stays a plane
    assert means.sd_m == pytest.approx(0.3)
    assert place_soundings(means, ReadOptions(), PLACE).soundings.sd_m == pytest.approx(0.3)
    assert "20000 near the area were averaged to the map's cells of 2 m" in means.notes[0]
    # A reference is the same, whichever way the means are taken.
    first, second = (place_reference(found, ReadOptions(), PLACE)[0] for found in (whole, means))
    np.testing.assert_allclose(first, second, atol=1e-6)


def test_a_cell_whose_soundings_state_no_deviation_states_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "MAX_SOUNDINGS", 1000)
    found = filled(pings(10, step_m=2.0)).points([], 0)
    assert np.isnan(found.sd_m).all()
    # What is assumed, and what the sonar says of its detections.
    assert place_soundings(found, ReadOptions(sd_m=0.4), PLACE).soundings.sd_m == pytest.approx(0.5)


def test_memory_does_not_grow_with_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "MAX_SOUNDINGS", 20_000)
    monkeypatch.setattr(table, "BATCH_SOUNDINGS", 4000)

    def peak(count: int) -> int:
        tracemalloc.start()
        filled(pings(count)).points([], 0)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(100)
    assert peak(1200) < 1.2 * peak(300)


def test_soundings_elsewhere_are_counted_and_left_out() -> None:
    far = LocalFrame(-41.0, 170.0)
    beside = LocalFrame(41.1850, -8.7000)  # 335 m to the east
    mixed = filled(ping for part in (pings(3), pings(4, beside), pings(5, far)) for ping in part).points([], 2)
    assert (len(mixed.z), mixed.found) == (3 * BEAMS, 12 * BEAMS)
    assert "2 pings are incomplete" in mixed.notes[0]
    with pytest.raises(ReadError, match="none of its depths lies near"):
        filled(pings(4, far)).points([], 0)


def test_a_place_on_the_other_side_of_the_180th_meridian_is_near() -> None:
    place = MapExtent(LocalFrame(-17.0, 180.0), PLACE.grid, 5.0)
    beside = LocalFrame(-17.0, -179.9999)  # 11 m to the east
    found = filled(pings(2, beside), place).points([], 0)
    assert found.x.min() == pytest.approx(10.65 - 15.0, abs=0.2)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 12_000.0, -12_000.0])
@pytest.mark.parametrize("column", ["depth_m", "starboard_m", "forward_m"])
def test_soundings_that_cannot_be_are_refused_with_their_ping(column: str, wrong: float) -> None:
    [first, second] = pings(2)
    values = getattr(second, column).copy()
    values[7] = 2e6 if column != "depth_m" and np.isfinite(wrong) else wrong
    found = filled(iter([first]))
    with pytest.raises(ReadError, match="deeper than 11100 m") as refused:
        found.add(replace(second, **{column: values}))
    assert refused.value.field == "ping 2"
    rejected = second.rejected.copy()
    rejected[7] = True
    found.add(replace(second, **{column: values}, rejected=rejected))
    assert found.points([], 0).found == 2 * BEAMS - 1
