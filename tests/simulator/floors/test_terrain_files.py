import gzip
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine

from app.arrays import FloatArray
from simulator.floors import seafloors
from simulator.floors.terrain import TerrainError
from simulator.floors.terrain_files import load_terrain, save_npz
from tests.support.paths import TERRAINS

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")

FLOOR = seafloors.generate("slope", 4, width_m=40, height_m=30, cell_m=2.0, origin=(41.18, -8.7))


def write_esri(path: Path, z: FloatArray, cell: float, nodata: float = -9999.0) -> None:
    rows = np.where(np.isnan(z), nodata, z)[::-1]
    header = f"ncols {z.shape[1]}\nnrows {z.shape[0]}\nxllcorner 0\nyllcorner 0\ncellsize {cell}\n"
    body = "\n".join(" ".join(f"{value:.6f}" for value in row) for row in rows)
    path.write_text(f"{header}NODATA_value {nodata}\n{body}\n")


def write_geotiff(path: Path, z: FloatArray, transform: Affine, crs: str) -> None:
    import rasterio

    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        height=z.shape[0],
        width=z.shape[1],
        count=1,
        dtype="float64",
        nodata=-1.0,
        transform=transform,
        crs=crs,
    ) as target:
        target.write(np.where(np.isnan(z), -1.0, z)[::-1], 1)


def test_npz_comes_back_as_written(tmp_path: Path) -> None:
    save_npz(FLOOR, tmp_path / "floor.npz")
    back = load_terrain(tmp_path / "floor.npz")
    np.testing.assert_allclose(back.z_m, FLOOR.z_m, rtol=1e-6)
    assert (back.cell_m, back.origin_lat_deg, back.origin_lon_deg) == (2.0, 41.18, -8.7)


@pytest.mark.parametrize("packed", [False, True])
def test_esri_ascii_is_turned_south_up(tmp_path: Path, packed: bool) -> None:
    z = FLOOR.z_m.copy()
    z[2, 3] = np.nan
    path = tmp_path / "floor.asc"
    write_esri(path, z, 2.0)
    if packed:
        packed_path = tmp_path / "floor.asc.gz"
        packed_path.write_bytes(gzip.compress(path.read_bytes()))
        path = packed_path
    back = load_terrain(path)
    np.testing.assert_allclose(back.z_m, z, atol=1e-6)
    assert back.cell_m == 2.0


def test_a_projected_geotiff_keeps_cells_and_place(tmp_path: Path) -> None:
    import pyproj
    from rasterio.transform import from_origin

    z = FLOOR.z_m.copy()
    z[0, 0] = np.nan
    east, north = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32629", always_xy=True).transform(-8.7, 41.18)
    write_geotiff(tmp_path / "floor.tif", z, from_origin(east, north + 30, 2, 2), "EPSG:32629")
    back = load_terrain(tmp_path / "floor.tif")
    np.testing.assert_allclose(back.z_m, z)
    assert back.cell_m == pytest.approx(2.0)
    assert back.origin_lat_deg == pytest.approx(41.18, abs=1e-9)
    assert back.origin_lon_deg == pytest.approx(-8.7, abs=1e-9)


def test_a_geotiff_in_degrees_becomes_metres(tmp_path: Path) -> None:
    from rasterio.transform import from_origin

    floor = seafloors.generate("smooth", 1, width_m=200, height_m=200, cell_m=2.0)
    per_lat, per_lon = 111_060.0, 83_900.0
    transform = from_origin(-8.7, 41.18 + 200 / per_lat, 2 / per_lon, 2 / per_lat)
    write_geotiff(tmp_path / "floor.tif", floor.z_m, transform, "EPSG:4326")
    back = load_terrain(tmp_path / "floor.tif")
    assert back.cell_m == pytest.approx(2.0, rel=0.01)
    assert back.width_m == pytest.approx(200, rel=0.02)
    e, n = np.meshgrid(np.linspace(20, 180, 9), np.linspace(20, 180, 9))
    np.testing.assert_allclose(back.depth_at(e, n), floor.depth_at(e, n), atol=0.15)


def soundings() -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(0)
    corners = np.array([[0, 0], [40, 0], [0, 30], [40, 30]], dtype=float)
    at = np.vstack([corners, rng.uniform(0, 1, (4000, 2)) * [40, 30]])
    return at, FLOOR.depth_at(at[:, 0], at[:, 1])


@pytest.mark.parametrize(
    ("name", "header", "separator", "shift"),
    [
        ("s.csv", "east_m,north_m,depth_m\n", ",", 0.0),
        ("s.csv", "id;x;y;z\n", ";", -1000.0),
        ("s.csv.gz", "east_m,north_m,depth_m\n", ",", 0.0),
        ("s.xyz", "", " ", 0.0),
        ("s.xyz", "# a comment\n# east north depth\n", "\t", 500.0),
    ],
)
def test_scattered_soundings_are_triangulated(
    tmp_path: Path, name: str, header: str, separator: str, shift: float
) -> None:
    at, depth = soundings()
    number = "7;" if header.startswith("id") else ""
    lines = [
        number + separator.join(f"{value:.4f}" for value in (e + shift, n + shift, d))
        for (e, n), d in zip(at, depth, strict=True)
    ]
    text = header + "\n".join(lines) + "\n"
    path = tmp_path / name
    path.write_bytes(gzip.compress(text.encode()) if name.endswith(".gz") else text.encode())
    back = load_terrain(path, cell_m=1.0)
    assert (back.rows, back.cols) == (30, 40)
    e, n = np.meshgrid(np.arange(3, 38), np.arange(3, 28))
    np.testing.assert_allclose(back.depth_at(e, n), FLOOR.depth_at(e, n), atol=0.2)


def test_soundings_in_degrees_get_a_place(tmp_path: Path) -> None:
    at, depth = soundings()
    lat, lon = np.transpose([FLOOR.frame.to_geodetic(e, n) for e, n in at])
    rows = "\n".join(f"{a:.9f},{b:.9f},{d:.4f}" for a, b, d in zip(lat, lon, depth, strict=True))
    path = tmp_path / "s.csv"
    path.write_text("lat,lon,depth_m\n" + rows)
    back = load_terrain(path, cell_m=1.0)
    assert back.origin_lat_deg == pytest.approx(41.18, abs=1e-6)
    assert back.origin_lon_deg == pytest.approx(-8.7, abs=1e-6)
    assert back.depth_at(20, 15) == pytest.approx(float(FLOOR.depth_at(20, 15)), abs=0.1)


def test_the_default_cell_is_finer_than_the_soundings(tmp_path: Path) -> None:
    e, n = np.meshgrid(np.arange(0, 100, 6.0), np.arange(0, 100, 6.0))
    rows = "\n".join(f"{a} {b} {5 + a / 50}" for a, b in zip(e.ravel(), n.ravel(), strict=True))
    (tmp_path / "s.xyz").write_text(rows)
    assert load_terrain(tmp_path / "s.xyz").cell_m == 2.0


def test_heights_can_be_turned_into_depths(tmp_path: Path) -> None:
    save_npz(FLOOR, tmp_path / "floor.npz")
    back = load_terrain(tmp_path / "floor.npz", vertical="up")
    np.testing.assert_allclose(back.z_m, -FLOOR.z_m, rtol=1e-6)


class Evil:
    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
        return (os.system, ("touch owned",))


def pickled(path: Path) -> None:
    np.savez(path, z=np.array([Evil()], dtype=object), cell_m=1.0)


BAD_FILES: dict[str, tuple[Any, str]] = {
    "not a zip.npz": (b"hello", "numpy.savez_compressed"),
    "no z.npz": (lambda p: np.savez(p, cell_m=1.0), "'z' is missing"),
    "no cell.npz": (lambda p: np.savez(p, z=np.ones((3, 3))), "'cell_m' is missing"),
    "text.npz": (lambda p: np.savez(p, z=np.array([["a", "b"], ["c", "d"]]), cell_m=1.0), "it must be numbers"),
    "cells.npz": (lambda p: np.savez(p, z=np.ones((3, 3)), cell_m=np.ones(2)), "cell_m has shape"),
    "nan cell.npz": (lambda p: np.savez(p, z=np.ones((3, 3)), cell_m=np.nan), "cell_m is nan"),
    "negative.npz": (lambda p: np.savez(p, z=np.ones((3, 3)), cell_m=-2.0), "cell_m is -2.0"),
    "flat.npz": (lambda p: np.savez(p, z=np.ones(9), cell_m=1.0), "2-D"),
    "half place.npz": (
        lambda p: np.savez(p, z=np.ones((3, 3)), cell_m=1.0, origin_lat=41.0),
        "both or neither",
    ),
    "pickle.npz": (pickled, "plain arrays"),
    "empty.asc": (b"", "'ncols' is missing"),
    "header.asc": (b"ncols x\n", "ncols is 'x'"),
    "short.asc": (b"ncols 3\nnrows 3\ncellsize 1\n1 2 3\n", "3 values where nrows x ncols = 9"),
    "letters.asc": (b"ncols 2\nnrows 2\ncellsize 1\n1 2\n3 x\n", "not a number"),
    "huge.asc": (b"ncols 99999999\nnrows 99999999\ncellsize 1\n1\n", "at most"),
    "cell.asc": (b"ncols 2\nnrows 2\ncellsize 0\n1 2\n3 4\n", "cell_m is 0"),
    "binary.asc": (b"ncols \xff\xfe", "UTF-8"),
    "not a tiff.tif": (b"II*\0garbage", "GeoTIFF"),
    "two.xyz": (b"1 2 3\n4 5 6\n", "at least 3"),
    "line.xyz": (b"0 0 1\n1 1 1\n2 2 1\n3 3 1\n", "one line"),
    "columns.csv": (b"time,depth\n1,2\n", "east_m, north_m, depth_m"),
    "words.csv": (b"east_m,north_m,depth_m\n1,2,deep\n", "line 2"),
    "narrow.xyz": (b"1 2\n3 4\n5 6\n", "line 1"),
    "not gzip.csv.gz": (b"east_m,north_m,depth_m\n", "not gzip"),
    "floor.docx": (b"", "ending '.docx'"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_malformed_files_say_what_would_be_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    content, message = BAD_FILES[name]
    path = tmp_path / name
    if callable(content):
        content(path)
    else:
        path.write_bytes(content)
    with pytest.raises(TerrainError, match=message) as caught:
        load_terrain(path)
    assert name in str(caught.value), "the message names the file"
    assert not Path("owned").exists()


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(TerrainError, match=r"nowhere\.npz: no such file"):
        load_terrain(tmp_path / "nowhere.npz")


def test_a_truncated_archive_is_refused(tmp_path: Path) -> None:
    save_npz(FLOOR, tmp_path / "floor.npz")
    whole = (tmp_path / "floor.npz").read_bytes()
    for cut in (10, len(whole) // 2, len(whole) - 5):
        (tmp_path / "cut.npz").write_bytes(whole[:cut])
        with pytest.raises(TerrainError, match=r"cut\.npz"):
            load_terrain(tmp_path / "cut.npz")


def real_terrains() -> list[Path]:
    return sorted(p for p in TERRAINS.glob("*") if p.name.endswith((".npz", ".csv.gz")) and "large" not in p.name)


@pytest.mark.terrains
@pytest.mark.skipif(not real_terrains(), reason="no real terrains beside the project")
def test_every_real_terrain_is_read() -> None:
    for path in real_terrains():
        terrain = load_terrain(path)
        assert terrain.min_depth_m > 0.0, path
        assert np.isfinite(terrain.depth_at(0.5 * terrain.width_m, 0.5 * terrain.height_m)) or "soundings" in str(path)
