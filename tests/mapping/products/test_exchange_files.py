"""NetCDF, BAG, KML, GPX, GeoJSON and B-12: each file is opened again by libraries that did not write it."""

import io
import json
import resource
import xml.etree.ElementTree as ET
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import csbschema
import fastkml
import gpxpy
import h5py
import netCDF4
import numpy as np
import pyogrio
import pyproj
import pytest
import rasterio
from compliance_checker.runner import CheckSuite, ComplianceChecker

from app.mapping.bag_values import NODATA
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.layers import LayerSource, file_layers
from app.mapping.products.bag import bag
from app.mapping.products.contours import find_contours
from app.mapping.products.crowdsourced import CrowdsourcedFile, Provider, RawSounding
from app.mapping.products.kml import contours_kml, tracks_kml
from app.mapping.products.netcdf import netcdf
from app.mapping.products.tracks import Track, TrackPoint, tracks_geojson, tracks_gpx
from app.mapping.types import BathymetricMap, Grid
from app.mapping.water.vertical import INSTANTANEOUS_WATER_LEVEL, VerticalDatum

FRAME = LocalFrame(41.1850, -8.7040)
GRID = Grid(west_m=0.0, south_m=0.0, cell_m=2.0, rows=12, cols=17)
LAT = VerticalDatum(5861, "EPSG:5861 LAT depth, by level +1.20 m (tide: gauge & <clock>)")
SEA = VerticalDatum(INSTANTANEOUS_WATER_LEVEL, "instantaneous water level (tide: none applied)")
CREATED = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
TITLE = "Quay & <pier>"
TRACKS = [
    Track("lauv-1", [TrackPoint(-8.704 + 1e-5 * i, 41.185, 2.0 + i, 1.79e9 + i) for i in range(5)]),
    Track("lauv-2", [TrackPoint(-8.704, 41.1851, 3.0, 1.79e9)]),
]


@pytest.fixture
def bathymetry() -> BathymetricMap:
    east, north = np.meshgrid(GRID.east_m, GRID.north_m)
    depth = 6.0 + 0.1 * east + 0.05 * north
    depth[9:, :3] = np.nan
    count = np.zeros(depth.shape, np.int64)
    count[:, 5] = 2
    prior = np.zeros(depth.shape, bool)
    prior[0, 8] = True
    sd = np.where(np.isnan(depth), np.nan, 0.2)
    return BathymetricMap(GRID, depth, sd, count, count > 0, np.ones_like(depth), 8.0, "test model", prior)


def nc_bytes(bathymetry: BathymetricMap, datum: VerticalDatum) -> bytes:
    layers = file_layers(LayerSource(bathymetry, reference_m=bathymetry.depth_m + 0.25))
    return netcdf(bathymetry, layers, FRAME, vertical_datum=datum, title=TITLE, created=CREATED)


@pytest.mark.parametrize("datum", [LAT, SEA], ids=["lat", "sea"])
def test_netcdf_passes_a_cf_checker(bathymetry: BathymetricMap, datum: VerticalDatum, tmp_path: Path) -> None:
    path = tmp_path / "map.nc"
    path.write_bytes(nc_bytes(bathymetry, datum))
    CheckSuite.load_all_available_checkers()
    report = tmp_path / "report.json"
    ComplianceChecker.run_checker(
        str(path), ["cf:1.8"], 1, "strict", output_filename=str(report), output_format="json_new"
    )
    (checked,) = json.loads(report.read_text()).values()
    (result,) = checked.values()
    # The bare coordinate of the projection has no unit of time or height; nothing else may be found fault with.
    faults = [
        message
        for level in ("high", "medium", "low")
        for one in result[f"{level}_priorities"]
        for message in one["msgs"]
    ]
    assert faults == []


def test_netcdf_holds_layers_places_and_datum(bathymetry: BathymetricMap) -> None:
    with h5py.File(io.BytesIO(nc_bytes(bathymetry, LAT))) as file:
        assert file["depth"].attrs["positive"] == b"down"
        assert "standard_name" not in file["depth"].attrs  # the conventions have no name for depths below LAT
        values = file["depth"][:]
        fill = file["depth"].attrs["_FillValue"][0]
        np.testing.assert_allclose(np.where(values == fill, np.nan, values), bathymetry.depth_m, rtol=1e-6)
        flags = file["sounded"][:]
        assert (flags[0, 5], flags[0, 8], flags[0, 0], flags[11, 0]) == (1, 2, 0, -1)
        np.testing.assert_allclose(file["difference"][0], -0.25, atol=1e-6)
        lat, lon = FRAME.to_geographic(GRID.east_m[3], GRID.north_m[7])
        assert (file["lat"][7, 3], file["lon"][7, 3]) == pytest.approx((float(lat), float(lon)), abs=1e-12)
        vertical = pyproj.CRS.from_wkt(file["crs"].attrs["crs_wkt"].decode()).sub_crs_list[1]
        assert vertical.to_epsg() == 5861


def test_netcdf_is_a_raster_to_gdal(bathymetry: BathymetricMap, tmp_path: Path) -> None:
    path = tmp_path / "map.nc"
    path.write_bytes(nc_bytes(bathymetry, SEA))
    with rasterio.open(f"netcdf:{path}:depth") as file:
        assert file.crs.is_projected
        assert file.bounds == pytest.approx((0.0, 0.0, 34.0, 24.0))
        np.testing.assert_allclose(file.read(1, masked=True)[::-1].filled(np.nan), bathymetry.depth_m, rtol=1e-6)
    with netCDF4.Dataset(path) as file:
        assert file["depth"].standard_name == "sea_floor_depth_below_sea_surface"
        assert file["uncertainty"].standard_name == "sea_floor_depth_below_sea_surface standard_error"


def test_bag_states_its_datum_and_holds_elevations(bathymetry: BathymetricMap, tmp_path: Path) -> None:
    path = tmp_path / "map.bag"
    path.write_bytes(bag(bathymetry, FRAME, vertical_datum=LAT, title=TITLE, common_sd_m=0.0))
    with rasterio.open(path) as file:
        assert file.descriptions == ("elevation", "uncertainty", "num_soundings")
        np.testing.assert_array_equal(
            file.read(3)[::-1], np.where(np.isfinite(bathymetry.depth_m), bathymetry.count, 0)
        )
        vertical = pyproj.CRS.from_wkt(file.crs.to_wkt()).sub_crs_list[1]
        assert (vertical.name, vertical.axis_info[0].direction) == ("LAT height", "up")
        assert vertical.datum == pyproj.CRS.from_epsg(5861).datum
        assert file.bounds == pytest.approx((0.0, 0.0, 34.0, 24.0))
        np.testing.assert_allclose(file.read(1, masked=True)[::-1].filled(np.nan), -bathymetry.depth_m, rtol=1e-6)
    with h5py.File(path) as file:
        elevation = file["BAG_root/elevation"][:]  # row 0 is south in the format itself
        np.testing.assert_allclose(elevation[0], -bathymetry.depth_m[0], rtol=1e-6)
        assert elevation[11, 0] == NODATA
        np.testing.assert_allclose(file["BAG_root/uncertainty"][0], 0.2, rtol=1e-6)
        metadata = ET.fromstring(b"".join(file["BAG_root/metadata"][:]))  # noqa: S314 - written here
    text = " ".join(metadata.itertext())
    assert "Lowest Astronomical Tide" in text
    assert TITLE in text
    assert "gauge & <clock>" in text


@pytest.mark.parametrize("room_bytes", [0, 8192])
def test_a_bag_for_which_the_disk_has_no_room_is_not_made(bathymetry: BathymetricMap, room_bytes: int) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room_bytes, before[1]))
    try:
        with pytest.raises(OSError, match="TMPDIR"):
            bag(bathymetry, FRAME, vertical_datum=LAT, title=TITLE, common_sd_m=0.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_contours_in_kml_lie_at_their_depth(bathymetry: BathymetricMap) -> None:
    text = contours_kml(find_contours(bathymetry, FRAME, 1.0), title=TITLE, vertical_datum=LAT.statement)
    document: Any = fastkml.KML.from_string(text, strict=True).features[0]  # type: ignore[arg-type]
    assert document.name == TITLE
    assert [mark.name for mark in document.features] == ["7 m", "8 m", "9 m", "10 m"]
    for mark in document.features:
        for line in mark.geometry.geoms:
            lon, lat = np.array(line.coords)[:, :2].T
            east, north = FRAME.to_local(lat, lon)
            np.testing.assert_allclose(6.0 + 0.1 * east + 0.05 * north, float(mark.name.split()[0]), atol=2e-3)


def test_tracks_come_back_from_every_format(tmp_path: Path) -> None:
    expected = [(p.lon_deg, p.lat_deg) for p in TRACKS[0].points]

    (track,) = gpxpy.parse(tracks_gpx(TRACKS, title=TITLE).decode()).tracks
    points = track.segments[0].points
    assert track.name == "lauv-1"
    np.testing.assert_allclose([(p.longitude, p.latitude) for p in points], expected, atol=1e-8)
    assert [p.elevation for p in points] == [-2.0, -3.0, -4.0, -5.0, -6.0]
    assert [p.time.timestamp() for p in points] == [p.time_s for p in TRACKS[0].points]

    (path := tmp_path / "tracks.geojson").write_bytes(tracks_geojson(TRACKS))
    meta, _, geometry, fields = pyogrio.raw.read(path)
    assert len(geometry) == 1
    assert list(fields[list(meta["fields"]).index("vehicle")]) == ["lauv-1"]
    assert meta["geometry_type"] == "LineString"

    text = tracks_kml(TRACKS, title=TITLE)
    document: Any = fastkml.KML.from_string(text, strict=True).features[0]  # type: ignore[arg-type]
    assert [mark.name for mark in document.features] == ["lauv-1"]
    track = document.features[0].kml_geometry
    places = np.array([(item.coord.x, item.coord.y, item.coord.z) for item in track.track_items])
    np.testing.assert_allclose(places[:, :2], expected, atol=1e-8)
    assert places[:, 2].tolist() == [-2.0, -3.0, -4.0, -5.0, -6.0]
    assert b"<altitudeMode>absolute</altitudeMode>" in text
    assert [item.when.dt.timestamp() for item in track.track_items] == [p.time_s for p in TRACKS[0].points]


def test_the_surface_is_at_zero_not_below() -> None:
    track = Track("a", [TrackPoint(-8.7, 41.2, depth, 1.79e9 + i) for i, depth in enumerate((0.0, 0.0004, -0.0004))])
    for file in (tracks_gpx([track], title=""), tracks_kml([track], title=""), tracks_geojson([track])):
        assert b"-0.0" not in file


def test_a_clock_gone_wild_does_not_keep_a_track_from_leaving() -> None:
    wild = Track("a", [TrackPoint(0.0, 0.0, 1.0, time) for time in (-1e30, 1e30)])
    assert len(json.loads(tracks_geojson([wild]))["features"][0]["properties"]["times"]) == 2
    assert len(gpxpy.parse(tracks_gpx([wild], title="").decode()).tracks[0].segments[0].points) == 2


@pytest.mark.parametrize("position_sd_m", [None, 1.5])
def test_crowdsourced_soundings_are_valid_b12(position_sd_m: float | None, tmp_path: Path) -> None:
    raw = [RawSounding(-8.704, 41.185 + 1e-5 * i, 9.876, 0.1, 1.79e9 + 0.25 * i, position_sd_m) for i in range(4)]
    provider = Provider("Harbour & Sons", "map@example.org", "HARBOUR", "CC0 1.0")
    file = CrowdsourcedFile("lauv-1", provider, "1.0", CREATED, uncertain=position_sd_m is not None)
    parts = [file.part(raw[:1], first=True), file.part(raw[1:], first=False), file.part([], first=False)]
    (path := tmp_path / "b12.geojson").write_bytes(b"".join([file.begin(), *parts, file.end()]))
    valid, found = csbschema.validate_data(path, version="3.1.0-2024-04")
    assert valid, found.get("errors")
    first = json.loads(path.read_text())
    assert [f["properties"]["depth"] for f in first["features"]] == [9.876] * 4
    assert first["features"][1]["properties"]["time"] == "2026-09-21T14:13:20.250Z"
    later = CrowdsourcedFile("lauv-1", provider, "2.0", CREATED, uncertain=False)
    again = json.loads(later.begin() + later.end())
    identity = first["properties"]["trustedNode"]["uniqueVesselID"]
    assert identity == again["properties"]["trustedNode"]["uniqueVesselID"]
