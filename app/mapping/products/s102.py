"""Map as Bathymetric Surface (IHO S-102, edition 3.0.0, encoded after S-100 part 10c): what charts are made with."""

import io
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import h5py
import numpy as np
import pyproj

from app.arrays import BoolArray, FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import UTM, ProjectedCells, named_frame, projected_cells
from app.mapping.products.tracks import utc_text
from app.mapping.types import BathymetricMap, Grid
from app.mapping.water.vertical import VerticalDatum

PRODUCT = "INT.IHO.S-102.3.0.0"
FILL, NO_RECORD = 1_000_000.0, 0
"""Of depth and uncertainty, and of the number of the record that describes a cell."""
DEPTH_AXIS_DOWN = 6498
"""EPSG code of a vertical axis in metres, positive down."""
UNKNOWN = -1.0
NO_TIME = "00010101T000000Z"
SURVEYED, IMPORTED = 1, 2
"""Records of the quality coverage."""
UNASSESSED = 2
NO_PRODUCER = "BF00"
"""Stands for the code of the producer, which the IHO gives to offices."""

CELLS, QUALITY = "BathymetryCoverage", "QualityOfBathymetryCoverage"
AXES = ("Easting", "Northing")
REGULAR_GRID, FEATURE_ORIENTED_GRID = 2, 9

Members = Mapping[str, int]
CODING_FORMATS: Members = {
    "fixedStations": 1,
    "regularGrid": REGULAR_GRID,
    "ungeorectifiedGrid": 3,
    "movingPlatform": 4,
    "irregularGrid": 5,
    "variableCellSize": 6,
    "TIN": 7,
    "stationwiseFixed": 8,
    "featureOrientedRegularGrid": FEATURE_ORIENTED_GRID,
}
COMMON_POINT_RULES: Members = {"average": 1, "low": 2, "high": 3, "all": 4}
SEQUENCING: Members = {
    "linear": 1,
    "boustrophedonic": 2,
    "CantorDiagonal": 3,
    "spiral": 4,
    "Morton": 5,
    "Hilbert": 6,
}
INTERPOLATION: Members = {
    "nearestneighbor": 1,
    "bilinear": 5,
    "biquadratic": 6,
    "bicubic": 7,
    "barycentric": 9,
    "discrete": 10,
}
DATA_OFFSETS: Members = {
    'XMin, YMin ("Lower left") corner ("Cell origin")': 1,
    'XMax, YMax ("Upper right") corner': 2,
    'XMax, YMin ("Lower right") corner': 3,
    'XMin, YMax ("Upper left") corner': 4,
    "Barycenter (centroid) of cell": 5,
}
COORDINATE_BASES: Members = {"seaSurface": 1, "verticalDatum": 2, "seaBottom": 3}
DATUM_REFERENCES: Members = {"s100VerticalDatum": 1, "EPSG": 2}
UNCERTAINTY_TYPES: Members = {
    "unknown": 0,
    "rawStandardDeviation": 1,
    "cUBEStandardDeviation": 2,
    "productUncertainty": 3,
    "historicalStandardDeviation": 4,
}

FEATURE_COLUMNS = ("code", "name", "uom.name", "fillValue", "datatype", "lower", "upper", "closure")
FEATURES = {
    CELLS: (
        ("depth", "depth", "metres", "1000000", "H5T_FLOAT", "-14", "11050", "closedInterval"),
        ("uncertainty", "uncertainty", "metres", "1000000", "H5T_FLOAT", "0", "", "geSemiInterval"),
    ),
    QUALITY: (("iD", "ID", "", "0", "H5T_INTEGER", "1", "", "geSemiInterval"),),
}
TEXT = h5py.string_dtype()
DATE = h5py.string_dtype("ascii", 8)
FLAG, REAL, LONG_REAL, NUMBER = np.dtype("u1"), np.dtype("<f4"), np.dtype("<f8"), np.dtype("<u4")


@dataclass(frozen=True)
class SurveyFacts:
    """What is known of a survey as a whole.

    Attributes
    ----------
    source_id
        What its records call it.
    authority
        Who was responsible for it; empty: nobody said.
    first_time_s, last_time_s
        Unix seconds of its first and last sounding; None where nobody sounded.
    position_95_m
        Radius that holds 95 % of its soundings' true positions; None where not all of them state it.
    common_sd_m
        Standard deviation of what all its soundings share, such as the tide.
    full_coverage
        Whether all of the area's sea floor was swept.
    """

    source_id: str
    authority: str = ""
    first_time_s: float | None = None
    last_time_s: float | None = None
    position_95_m: float | None = None
    common_sd_m: float = 0.0
    full_coverage: bool = False


def s102(
    bathymetry: BathymetricMap,
    frame: LocalFrame,
    survey: SurveyFacts,
    *,
    vertical_datum: VerticalDatum,
    issued: datetime,
) -> bytes:
    """Return depth, uncertainty (one standard deviation) and quality of the cells that were sounded, in a UTM zone.

    What was sounded in an earlier survey has a quality record of its own. Cells that nobody sounded are filled.

    Raises
    ------
    ValueError
        When the vertical datum is not one of S-100's, or nothing was sounded.
    """
    datum = vertical_datum.s100
    if datum is None:
        raise ValueError(f"S-102 has no number for the vertical datum, {vertical_datum.statement}")
    measured = bathymetry.sounded if bathymetry.prior is None else bathymetry.sounded | bathymetry.prior
    cells = _cells(bathymetry, frame, measured & np.isfinite(bathymetry.depth_m))
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        _write_root(file, cells, datum, issued.astimezone(UTC))
        _write_features(file)
        for name, coding in ((CELLS, REGULAR_GRID), (QUALITY, FEATURE_ORIENTED_GRID)):
            _write_container(file.create_group(name), coding, survey.position_95_m)
            instance = file.create_group(f"{name}/{name}.01")
            _write_place(instance, cells.grid)
            instance.create_group("Group_001")
        sd_m = bathymetry.charted(survey.common_sd_m).sd_m
        _write_depths(file[f"{CELLS}/{CELLS}.01/Group_001"], cells, bathymetry.depth_m, sd_m)
        _write_quality(file[QUALITY], bathymetry.sounded, cells, survey)
    return content.getvalue()


def _cells(bathymetry: BathymetricMap, frame: LocalFrame, keep: BoolArray) -> ProjectedCells:
    """Return the cells to keep in the UTM zone of their middle. Raises ValueError when there are none."""
    if not keep.any():
        raise ValueError("no cell of the map was sounded")
    rows, cols = np.nonzero(keep)
    middle = float(bathymetry.grid.east_m[cols].mean()), float(bathymetry.grid.north_m[rows].mean())
    return projected_cells(bathymetry, named_frame(UTM, frame, *middle), keep)


def file_name(title: str, identity: str) -> str:
    """Return a name as S-100 wants it, of capital letters, digits and underscores, 19 of them at most."""
    words = "".join(c for c in title.upper() if c.isascii() and c.isalnum())
    return f"102{NO_PRODUCER}{words[:7]}_{identity[:4].upper()}.h5"


def _write_root(file: h5py.File, cells: ProjectedCells, datum: int, issued: datetime) -> None:
    _text(file, "productSpecification", PRODUCT)
    file.attrs.create("issueDate", f"{issued:%Y%m%d}", dtype=DATE)
    _text(file, "issueTime", f"{issued:%H%M%S}Z")
    file.attrs.create("horizontalCRS", cells.frame.epsg, dtype="<i4")
    _write_bounds(file, *_geographic_bounds(cells))
    file.attrs.create("verticalCS", DEPTH_AXIS_DOWN, dtype="<i4")
    _choice(file, "verticalCoordinateBase", COORDINATE_BASES, 2)
    _choice(file, "verticalDatumReference", DATUM_REFERENCES, 1)
    file.attrs.create("verticalDatum", datum, dtype="<u2")


def _geographic_bounds(cells: ProjectedCells) -> tuple[float, float, float, float]:
    """Return west, south, east and north of the outermost cells' borders, degrees."""
    grid = cells.grid
    to_degrees = pyproj.Transformer.from_crs(cells.frame.epsg, 4326, always_xy=True)
    east, north = grid.west_m + grid.cols * grid.cell_m, grid.south_m + grid.rows * grid.cell_m
    west, south, east, north = to_degrees.transform_bounds(grid.west_m, grid.south_m, east, north)
    return west, south, east, north


def _write_features(file: h5py.File) -> None:
    group = file.create_group("Group_F")
    group.create_dataset("featureCode", data=np.array(list(FEATURES), dtype=object), dtype=TEXT)
    row = np.dtype([(column, TEXT) for column in FEATURE_COLUMNS])
    for name, rows in FEATURES.items():
        group.create_dataset(name, data=np.array(list(rows), dtype=row))


def _write_container(group: h5py.Group, coding: int, position_95_m: float | None) -> None:
    """Write what a feature's instances share."""
    _choice(group, "dataCodingFormat", CODING_FORMATS, coding)
    group.attrs.create("dimension", 2, dtype=FLAG)
    _choice(group, "commonPointRule", COMMON_POINT_RULES, 2)
    group.attrs.create("horizontalPositionUncertainty", UNKNOWN if position_95_m is None else position_95_m, dtype=REAL)
    group.attrs.create("verticalUncertainty", UNKNOWN, dtype=REAL)
    group.attrs.create("numInstances", 1, dtype=FLAG)
    _choice(group, "sequencingRule.type", SEQUENCING, 1)
    _text(group, "sequencingRule.scanDirection", ",".join(AXES))
    _choice(group, "interpolationType", INTERPOLATION, 1)
    _choice(group, "dataOffsetCode", DATA_OFFSETS, 5)
    group.create_dataset("axisNames", data=np.array(AXES, dtype=object), dtype=TEXT)


def _write_place(instance: h5py.Group, grid: Grid) -> None:
    """Write where the first cell's middle lies; the bounds are those of cells' middles, too."""
    east, north = grid.east_m, grid.north_m
    _write_bounds(instance, east[0], north[0], east[-1], north[-1])
    instance.attrs.create("numGRP", 1, dtype=FLAG)
    instance.attrs.create("gridOriginLongitude", east[0], dtype=LONG_REAL)
    instance.attrs.create("gridOriginLatitude", north[0], dtype=LONG_REAL)
    instance.attrs.create("gridSpacingLongitudinal", grid.cell_m, dtype=LONG_REAL)
    instance.attrs.create("gridSpacingLatitudinal", grid.cell_m, dtype=LONG_REAL)
    instance.attrs.create("numPointsLongitudinal", grid.cols, dtype=NUMBER)
    instance.attrs.create("numPointsLatitudinal", grid.rows, dtype=NUMBER)
    _text(instance, "startSequence", "0,0")


def _write_bounds(group: h5py.Group, west: float, south: float, east: float, north: float) -> None:
    """Write a box; single precision must not make it smaller."""
    for name, value, outward in (
        ("westBoundLongitude", west, -np.inf),
        ("southBoundLatitude", south, -np.inf),
        ("eastBoundLongitude", east, np.inf),
        ("northBoundLatitude", north, np.inf),
    ):
        single = np.float32(value)
        inside = float(single) > value if outward < 0 else float(single) < value
        group.attrs.create(name, np.nextafter(single, np.float32(outward)) if inside else single, dtype=REAL)


def _write_depths(group: h5py.Group, cells: ProjectedCells, depth_m: FloatArray, sd_m: FloatArray) -> None:
    """Write depth and uncertainty in whole centimetres, the latter rounded up."""
    values = np.empty(cells.source.shape, dtype=[("depth", REAL), ("uncertainty", REAL)])
    for name, layer in (
        ("depth", np.round(depth_m, 2)),
        ("uncertainty", np.ceil(np.round(sd_m * 100.0, 6)) / 100.0),
    ):
        values[name] = cells.of(layer, FILL)
        known = values[name][cells.filled]
        group.attrs.create(f"minimum{name.capitalize()}", known.min(), dtype=REAL)
        group.attrs.create(f"maximum{name.capitalize()}", known.max(), dtype=REAL)
    _text(group, "timePoint", NO_TIME)
    group.create_dataset("values", data=values, **_compressed(values.shape))


def _write_quality(group: h5py.Group, sounded: BoolArray, cells: ProjectedCells, survey: SurveyFacts) -> None:
    records = np.where(cells.filled, np.where(cells.of(sounded, 0) > 0, SURVEYED, IMPORTED), NO_RECORD)
    group[f"{QUALITY}.01/Group_001"].create_dataset("values", data=records.astype(NUMBER), **_compressed(records.shape))
    columns: dict[str, tuple[np.dtype[Any], Any, Any]] = {
        "id": (NUMBER, SURVEYED, IMPORTED),
        "dataAssessment": (FLAG, UNASSESSED, UNASSESSED),
        "featuresDetected.leastDepthOfDetectedFeaturesMeasured": (FLAG, False, False),
        "featuresDetected.significantFeaturesDetected": (FLAG, False, False),
        "fullSeafloorCoverageAchieved": (FLAG, survey.full_coverage, False),
        # Without full coverage the format takes no cell for covered.
        "bathyCoverage": (FLAG, survey.full_coverage, False),
        "surveyDateRange.dateStart": (DATE, _day(survey.first_time_s), ""),
        "surveyDateRange.dateEnd": (DATE, _day(survey.last_time_s), ""),
        "sourceSurveyID": (TEXT, survey.source_id, "imported soundings"),
        "surveyAuthority": (TEXT, survey.authority, ""),
        "typeOfBathymetricEstimationUncertainty": (
            h5py.enum_dtype(dict(UNCERTAINTY_TYPES), basetype=FLAG),
            UNCERTAINTY_TYPES["unknown"],
            UNCERTAINTY_TYPES["historicalStandardDeviation"],
        ),
    }
    if survey.position_95_m is not None:
        fixed = "zoneOfConfidence.horizontalPositionUncertainty.uncertaintyFixed"
        columns[fixed] = (REAL, survey.position_95_m, np.nan)
    present = [record for record in (SURVEYED, IMPORTED) if np.any(records == record)]
    table = np.empty(len(present), dtype=[(name, kind) for name, (kind, *_) in columns.items()])
    for name, (_, *of_records) in columns.items():
        table[name] = [of_records[record - 1] for record in present]
    group.create_dataset("featureAttributeTable", data=table)


def _compressed(shape: tuple[int, ...]) -> dict[str, Any]:
    return {"compression": "gzip", "shuffle": True, "chunks": tuple(min(side, 256) for side in shape)}


def _day(time_s: float | None) -> str:
    return "" if time_s is None else utc_text(time_s)[:10].replace("-", "")


def _text(group: h5py.Group, name: str, value: str) -> None:
    group.attrs.create(name, value, dtype=TEXT)


def _choice(group: h5py.Group, name: str, members: Members, value: int) -> None:
    group.attrs.create(name, value, dtype=h5py.enum_dtype(dict(members), basetype=FLAG))
