"""Map and soundings as plain text."""

import io

import numpy as np

from app.arrays import FloatArray
from app.mapping.coordinates.projected import Frame
from app.mapping.types import CHARTED_SD, BathymetricMap, Soundings


def map_xyz(
    bathymetry: BathymetricMap,
    frame: Frame,
    *,
    vertical_datum: str,
    common_sd_m: float,
    geographic: bool = False,
    sounded_only: bool = False,
) -> bytes:
    """Return the cells as XYZ text, south-west to north-east; cells without depth are left out.

    Columns after a comment header: position, depth (positive down), standard deviation with ``common_sd_m`` of what all
    soundings share, count, sounded (1 or 0). Positions are cell centres: east and north of the frame, or
    longitude and latitude when ``geographic``.
    """
    keep = np.isfinite(bathymetry.depth_m)
    if sounded_only:
        keep &= bathymetry.sounded
    east, north = bathymetry.grid.centres_m[keep.ravel()].T
    x, y, names, digits = _positions(east, north, frame, geographic)
    header = (
        f"{names} depth_m sd_m count sounded\n"
        f"depth positive down, vertical datum: {vertical_datum}\nsd_m: {CHARTED_SD}\n{_frame_line(frame, geographic)}"
    )
    rows = np.column_stack(
        [
            x,
            y,
            bathymetry.depth_m[keep],
            bathymetry.charted(common_sd_m).sd_m[keep],
            bathymetry.count[keep],
            bathymetry.sounded[keep],
        ]
    )
    return _text(rows, header, [digits, digits, "%.3f", "%.3f", "%d", "%d"], " ")


def soundings_xyz(
    soundings: Soundings, frame: Frame, *, vertical_datum: str, geographic: bool = False, headed: bool = True
) -> bytes:
    """Return the soundings as XYZ text: position, depth (positive down) and standard deviation per line.

    ``headed``: comments come first; without them it goes on with a file that has them.
    """
    x, y, names, digits = _positions(soundings.east_m, soundings.north_m, frame, geographic)
    header = (
        f"{names} depth_m sd_m\ndepth positive down, vertical datum: {vertical_datum}\n"
        "sd_m: of each sounding by itself, without what all soundings share, such as the tide\n"
        f"{_frame_line(frame, geographic)}"
    )
    rows = np.column_stack([x, y, soundings.depth_m, soundings.sd_m])
    return _text(rows, header if headed else "", [digits, digits, "%.3f", "%.3f"], " ")


def _positions(
    east: FloatArray, north: FloatArray, frame: Frame, geographic: bool
) -> tuple[FloatArray, FloatArray, str, str]:
    if geographic:
        lat, lon = frame.to_geographic(east, north)
        return lon, lat, "lon_deg lat_deg", "%.8f"
    return east, north, frame.axis_names, "%.3f"


def _frame_line(frame: Frame, geographic: bool) -> str:
    if geographic:
        return "positions: WGS 84 (EPSG:4326)"
    return f"positions: {frame.statement}"


def _text(rows: FloatArray, header: str, formats: list[str], delimiter: str) -> bytes:
    stream = io.StringIO()
    np.savetxt(stream, rows, fmt=formats, delimiter=delimiter, header=header, comments="# ")
    return stream.getvalue().encode()
