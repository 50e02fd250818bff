"""Heights are above the very datum that depths are below."""

import pyproj
import pytest

from app.mapping.water.vertical import INSTANTANEOUS_WATER_LEVEL, S100_DATUMS, VerticalDatum


@pytest.mark.parametrize("epsg", [*S100_DATUMS, INSTANTANEOUS_WATER_LEVEL])
@pytest.mark.parametrize("version", ["WKT1_GDAL", "WKT2_2019"])
def test_heights_are_above_the_datum_and_positive_up(epsg: int, version: str) -> None:
    datum = VerticalDatum(epsg, "")
    heights = pyproj.CRS.from_wkt(datum.heights.to_wkt(version))
    assert heights.is_vertical
    (axis,) = heights.axis_info
    assert (axis.direction, axis.unit_name) == ("up", "metre")
    assert heights.name == datum.crs.name.strip().replace("depth", "height")
    assert datum.crs.datum is None or heights.datum == datum.crs.datum


def test_heights_that_are_registered_have_their_code() -> None:
    assert VerticalDatum(5715, "").heights.to_epsg() == 5714
    assert VerticalDatum(5861, "").heights.to_epsg() is None
