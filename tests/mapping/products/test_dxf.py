"""Contours as DXF are read by GDAL, group by group where it does not tell."""

from pathlib import Path

import numpy as np
import pyogrio
import pyproj
import pytest
import shapely

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import Frame, ProjectedFrame
from app.mapping.products.contours import contours_in_metres
from app.mapping.products.dxf import contours_dxf
from app.mapping.types import BathymetricMap, Grid

FRAME = LocalFrame(41.1850, -8.7040)
UTM = ProjectedFrame(32629, FRAME)
DATUM = "EPSG:5861 (lowest astronomical tide)"
INTERVAL_M = 0.5
PEAK_M = (30.0, 45.0)


@pytest.fixture(scope="module")
def bathymetry() -> BathymetricMap:
    """A cone under water, its top at PEAK_M, which dries by half a metre."""
    grid = Grid(west_m=-10.0, south_m=20.0, cell_m=1.0, rows=50, cols=80)
    east, north = np.meshgrid(grid.east_m, grid.north_m)
    depth = 0.2 * np.hypot(east - PEAK_M[0], north - PEAK_M[1]) - 0.7
    none = np.zeros(depth.shape, np.int64)
    return BathymetricMap(grid, depth, 0.0 * depth, none, none > 0, np.ones_like(depth), 8.0, "test")


def made(bathymetry: BathymetricMap, frame: Frame) -> bytes:
    found = contours_in_metres(bathymetry, frame, INTERVAL_M)
    return contours_dxf(found, INTERVAL_M, title="Leixões\n0\nEOF", positions=frame.statement, vertical_datum=DATUM)


def groups_of(content: bytes) -> list[tuple[int, str]]:
    lines = content.decode("ascii").splitlines()
    return [(int(code), value) for code, value in zip(lines[::2], lines[1::2], strict=True)]


@pytest.mark.slow
@pytest.mark.parametrize("frame", [FRAME, UTM], ids=["own", "utm"])
def test_gdal_reads_lines_at_their_elevation(bathymetry: BathymetricMap, frame: Frame, tmp_path: Path) -> None:
    (path := tmp_path / "contours.dxf").write_bytes(made(bathymetry, frame))
    meta, _, geometry, fields = pyogrio.raw.read(path)
    lines = shapely.from_wkb(geometry)
    layers = fields[list(meta["fields"]).index("Layer")]
    assert len(lines) > 10
    to_own = pyproj.Transformer.from_crs(frame.crs, FRAME.crs, always_xy=True)
    for line, layer in zip(lines, layers, strict=True):
        x, y, z = shapely.get_coordinates(line, include_z=True).T
        assert np.ptp(z) == 0.0
        east, north = to_own.transform(x, y)
        np.testing.assert_allclose(
            -z[0], 0.2 * np.hypot(east - PEAK_M[0], north - PEAK_M[1]) - 0.7, atol=0.02, err_msg=f"{z[0]}"
        )
        multiple = -z[0] / INTERVAL_M
        assert multiple == pytest.approx(round(multiple))
        assert layer == ("CONTOURS_INDEX" if round(multiple) % 5 == 0 else "CONTOURS")
    elevations = {round(float(shapely.get_coordinates(line, include_z=True)[0, 2]), 3) for line in lines}
    assert {0.5, 0.0, -0.5, -2.5} <= elevations
    # Around the top they are closed, those that leave the map are open.
    closed = [line for line in lines if line.is_closed]
    assert any(shapely.Polygon(line).contains(shapely.Point(*_placed(frame))) for line in closed)
    assert 0 < len(closed) < len(lines)


def _placed(frame: Frame) -> tuple[float, float]:
    if isinstance(frame, LocalFrame):
        return PEAK_M
    x, y = frame.from_local(*PEAK_M)
    return float(x), float(y)


def test_it_is_of_release_12_and_says_what_it_is_in(bathymetry: BathymetricMap) -> None:
    groups = groups_of(made(bathymetry, UTM))
    assert groups[:3] == [
        (999, "Leix?es 0 EOF"),
        (999, "positions: WGS 84 / UTM zone 29N (EPSG:32629)"),
        (999, f"elevations: minus the depth below {DATUM}"),
    ]
    assert groups[groups.index((9, "$ACADVER")) + 1] == (1, "AC1009")
    assert [value for code, value in groups if code == 0][-1] == "EOF"
    assert [value for code, value in groups if (code, value) == (0, "EOF")] == ["EOF"]
    sections = [groups[at + 1][1] for at, group in enumerate(groups) if group == (0, "SECTION")]
    assert sections == ["HEADER", "TABLES", "ENTITIES"]
    assert {group for group in groups if group[0] == 8} == {(8, "CONTOURS"), (8, "CONTOURS_INDEX")}
    begun = [at for at, group in enumerate(groups) if group == (0, "POLYLINE")]
    assert len(begun) == groups.count((0, "SEQEND"))
    # The corner of the drawing is that of its lines.
    low = groups.index((9, "$EXTMIN"))
    vertices = [at for at, group in enumerate(groups) if group == (0, "VERTEX")]
    assert float(groups[low + 1][1]) == min(float(groups[at + 2][1]) for at in vertices)
    assert float(groups[low + 3][1]) == min(float(groups[at + 4][1]) for at in vertices)
    assert not any(value.startswith("-0.000") for _, value in groups)


def test_a_map_without_contours_is_an_empty_drawing() -> None:
    content = contours_dxf([], 1.0, title="Quay", positions=FRAME.statement, vertical_datum=DATUM)
    assert (0, "POLYLINE") not in groups_of(content)
