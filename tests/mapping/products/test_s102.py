"""S-102 files: judged by the validator of GDAL's utilities, and read back by GDAL and by h5py."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np
import pyproj
import pytest
import rasterio

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import ProjectedFrame, projected_cells
from app.mapping.products.s102 import FILL, SurveyFacts, file_name, s102
from app.mapping.types import BathymetricMap, Grid
from app.mapping.water.vertical import INSTANTANEOUS_WATER_LEVEL, VerticalDatum

FRAME = LocalFrame(41.1850, -8.7040)
LAT = VerticalDatum(5861, "EPSG:5861 LAT depth")
SURVEY = SurveyFacts(
    "Quay (1234)", "Harbour & Sons", 1_790_000_000.0, 1_790_090_000.0, position_95_m=1.5, full_coverage=True
)
NAME = "102BF00QUAY_1234.h5"
QUALITY = "QualityOfBathymetryCoverage"
WITHOUT_GDAL = "skipped due to GDAL not available"


def made_map(*, imported: bool = False) -> BathymetricMap:
    grid = Grid(-20.0, 35.0, 2.0, 40, 60)
    east, north = np.meshgrid(grid.east_m, grid.north_m)
    depth = 40.0 + 0.1234 * east + 0.05 * north
    sounded = np.ones(depth.shape, dtype=bool)
    sounded[10:16, 20:30] = False
    prior = np.zeros_like(sounded)
    prior[10:13, 20:30] = imported
    return BathymetricMap(
        grid=grid,
        depth_m=depth,
        sd_m=0.1 + 0.001 * np.abs(east),
        count=6 * sounded,
        sounded=sounded,
        roughness=np.ones_like(depth),
        correlation_length_m=10.0,
        model="mean of the soundings in each cell",
        prior=prior if imported else None,
    )


def write(path: Path, bathymetry: BathymetricMap, survey: SurveyFacts = SURVEY) -> Path:
    issued = datetime(2026, 9, 23, 10, 11, 12, tzinfo=UTC)
    path.write_bytes(s102(bathymetry, FRAME, survey, vertical_datum=LAT, issued=issued))
    return path


@pytest.mark.parametrize("imported", [False, True])
@pytest.mark.parametrize("survey", [SURVEY, SurveyFacts("Quay")])
def test_the_validator_finds_nothing(imported: bool, survey: SurveyFacts, tmp_path: Path) -> None:
    validator = pytest.importorskip("osgeo_utils.samples.validate_s102", reason="pip install --no-deps gdal-utils")
    errors, warnings, done = validator.check(str(write(tmp_path / NAME, made_map(imported=imported), survey)))
    assert errors == []
    # Without GDAL's Python bindings it leaves one comparison out, which the test of the bounds makes.
    assert [warning for warning in warnings if WITHOUT_GDAL not in warning] == []
    assert len(done) > 50


@pytest.mark.parametrize(
    ("lat", "lon", "cell_m"), [(-0.01, 30.0, 0.5), (-33.0, 18.0, 0.1), (60.0, 5.9999, 5.0), (84.5, 10.0, 1.0)]
)
@pytest.mark.parametrize("rows", [1, 30])
def test_the_validator_finds_nothing_anywhere(lat: float, lon: float, cell_m: float, rows: int, tmp_path: Path) -> None:
    validator = pytest.importorskip("osgeo_utils.samples.validate_s102", reason="pip install --no-deps gdal-utils")
    whole = made_map()
    layers = {name: getattr(whole, name)[:rows] for name in ("depth_m", "sd_m", "count", "sounded", "roughness")}
    bathymetry = replace(whole, grid=replace(whole.grid, rows=rows, cell_m=cell_m), **layers)
    made = s102(bathymetry, LocalFrame(lat, lon), SURVEY, vertical_datum=LAT, issued=datetime.now(UTC))
    (path := tmp_path / NAME).write_bytes(made)
    errors, warnings, _ = validator.check(str(path))
    assert errors == []
    assert [warning for warning in warnings if WITHOUT_GDAL not in warning] == []


def test_the_bounds_hold_every_cell(tmp_path: Path) -> None:
    with h5py.File(write(tmp_path / NAME, made_map())) as file:
        root, instance = dict(file.attrs), dict(file["BathymetryCoverage/BathymetryCoverage.01"].attrs)
    west, south = instance["gridOriginLongitude"] - 1.0, instance["gridOriginLatitude"] - 1.0
    east = west + 2.0 * instance["numPointsLongitudinal"]
    north = south + 2.0 * instance["numPointsLatitudinal"]
    to_degrees = pyproj.Transformer.from_crs(int(root["horizontalCRS"]), 4326, always_xy=True)
    box = to_degrees.transform_bounds(west, south, east, north)
    stated = [root[f"{side}"] for side in ("westBoundLongitude", "southBoundLatitude")]
    stated += [root[f"{side}"] for side in ("eastBoundLongitude", "northBoundLatitude")]
    assert np.all(stated[:2] <= np.array(box[:2]))
    assert np.all(stated[2:] >= np.array(box[2:]))
    np.testing.assert_allclose(stated, box, atol=1e-5)


def test_gdal_reads_depth_uncertainty_and_quality(tmp_path: Path) -> None:
    bathymetry = made_map(imported=True)
    path = write(tmp_path / NAME, bathymetry)
    keep = bathymetry.sounded | (bathymetry.prior == np.True_)
    cells = projected_cells(bathymetry, ProjectedFrame(32629, FRAME), keep)
    with rasterio.open(f'S102:"{path}":BathymetryCoverage') as file:
        assert (file.crs.to_epsg(), file.nodata, file.descriptions) == (32629, FILL, ("depth", "uncertainty"))
        assert file.tags()["VERTICAL_DATUM_ABBREV"] == "LAT"
        depth, uncertainty = file.read()[:, ::-1]
        assert file.bounds[:2] == pytest.approx((cells.grid.west_m, cells.grid.south_m))
    np.testing.assert_allclose(depth, np.round(cells.of(bathymetry.depth_m, FILL), 2), rtol=1e-6)
    assert (uncertainty >= cells.of(bathymetry.sd_m, FILL) - 1e-6).all()
    np.testing.assert_allclose(uncertainty, cells.of(bathymetry.sd_m, FILL), atol=0.0101)
    with rasterio.open(f'S102:"{path}":{QUALITY}') as file:
        quality = file.read(1)[::-1]
    assert set(np.unique(quality)) == {0, 1, 2}
    assert ((quality == 0) == (depth == FILL)).all(), "what nobody measured is filled"
    east, north = pyproj.Transformer.from_crs(FRAME.crs, 32629, always_xy=True).transform(29.0, 63.0)
    unseen = int(north - cells.grid.south_m) // 2, int(east - cells.grid.west_m) // 2
    assert depth[unseen] == FILL


def test_records_say_what_is_known_and_nothing_more(tmp_path: Path) -> None:
    with h5py.File(write(tmp_path / NAME, made_map(imported=True))) as file:
        own, imported = file[f"{QUALITY}/featureAttributeTable"][:]
        assert file[QUALITY].attrs["horizontalPositionUncertainty"] == np.float32(1.5)
    day = [own[f"surveyDateRange.{name}"] for name in ("dateStart", "dateEnd")]
    assert day == [b"20260921", b"20260922"]
    assert (own["id"], own["sourceSurveyID"], own["surveyAuthority"]) == (1, b"Quay (1234)", b"Harbour & Sons")
    assert (own["fullSeafloorCoverageAchieved"], own["bathyCoverage"]) == (1, 1)
    assert (imported["id"], imported["surveyDateRange.dateStart"], imported["bathyCoverage"]) == (2, b"", 0)
    kind = "typeOfBathymetricEstimationUncertainty"
    assert (own[kind], imported[kind]) == (0, 4)

    with h5py.File(write(tmp_path / NAME, made_map(), SurveyFacts("Quay"))) as file:
        (own,) = file[f"{QUALITY}/featureAttributeTable"][:]
        assert file[QUALITY].attrs["horizontalPositionUncertainty"] == -1.0
    assert (own["surveyDateRange.dateStart"], own["surveyAuthority"]) == (b"", b"")
    assert (own["fullSeafloorCoverageAchieved"], own["bathyCoverage"]) == (0, 0)
    assert not any("horizontalPositionUncertainty" in name for name in own.dtype.names)


def test_a_clock_gone_wild_does_not_keep_a_surface_from_leaving(tmp_path: Path) -> None:
    with h5py.File(write(tmp_path / NAME, made_map(), SurveyFacts("Quay", "", -1e30, 1e30))) as file:
        (own,) = file[f"{QUALITY}/featureAttributeTable"][:]
    assert (own["surveyDateRange.dateStart"], own["surveyDateRange.dateEnd"]) == (b"19700101", b"99991231")


def test_the_uncertainty_includes_what_all_soundings_share(tmp_path: Path) -> None:
    bathymetry = replace(made_map(), sd_m=np.full((40, 60), 0.3))
    with h5py.File(write(tmp_path / NAME, bathymetry, SurveyFacts("Quay", common_sd_m=0.4))) as file:
        group = file["BathymetryCoverage/BathymetryCoverage.01/Group_001"]
        assert group.attrs["minimumUncertainty"] == group.attrs["maximumUncertainty"] == np.float32(0.5)


def test_depths_below_no_chart_datum_are_refused() -> None:
    sea = VerticalDatum(INSTANTANEOUS_WATER_LEVEL, "instantaneous water level")
    with pytest.raises(ValueError, match="instantaneous water level"):
        s102(made_map(), FRAME, SURVEY, vertical_datum=sea, issued=datetime.now(UTC))


@pytest.mark.parametrize(
    ("title", "name"),
    [("Leixões, quay 3", "102BF00LEIXESQ_AB12.h5"), ("海", "102BF00_AB12.h5")],
)
def test_files_have_names_of_the_series(title: str, name: str) -> None:
    assert file_name(title, "ab12cd34-…") == name
