"""Map as Bathymetric Attributed Grid (BAG 1.6), the exchange format of hydrographic offices."""

import errno
import io
import tempfile
from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.errors import RasterioError

from app.mapping.bag_values import NODATA
from app.mapping.coordinates.projected import Frame
from app.mapping.products.geotiff import north_up_transform
from app.mapping.types import CHARTED_SD, BathymetricMap
from app.mapping.water.vertical import VerticalDatum

NOT_WHOLE = "it cannot be written whole; is the disk that TMPDIR points to full?"


def bag(
    bathymetry: BathymetricMap,
    frame: Frame,
    *,
    vertical_datum: VerticalDatum,
    title: str,
    common_sd_m: float,
    counts_soundings: bool = True,
) -> bytes:
    """Return a BAG with elevation (positive up: minus the depth), its standard deviation and numbers of soundings.

    The deviation includes ``common_sd_m``, that of what all soundings share. Cells without a sounding have their
    predicted depths: the metadata tell how many. Where the map's counts are not of soundings, no numbers of them are
    written. The vertical datum stands there, too, as the system of heights above
    it; the library would call it unknown. Raises OSError where the file cannot be written whole.
    """
    count = np.where(np.isfinite(bathymetry.depth_m), bathymetry.count, 0).astype("<u4")
    layers = [
        np.where(np.isfinite(layer), layer, NODATA).astype(np.float32)[::-1]
        for layer in (-bathymetry.depth_m, bathymetry.charted(common_sd_m).sd_m)
    ]
    with tempfile.TemporaryDirectory(prefix="bathyfleet-") as folder:
        path = Path(folder) / "map.bag"  # HDF5 writes to real files only
        try:
            _write(path, layers, bathymetry, frame, vertical_datum, title, _predicted(bathymetry))
            whole = _holds(path, layers)
        except (RasterioError, SystemError) as error:
            raise OSError(errno.ENOSPC, NOT_WHOLE) from error
        if not whole:
            raise OSError(errno.ENOSPC, NOT_WHOLE)
        content = io.BytesIO(path.read_bytes())
    if not counts_soundings:
        return content.getvalue()
    with h5py.File(content, "r+") as file:
        numbers = file["BAG_root"].create_dataset("num_soundings", data=count, chunks=True, compression="gzip")
        numbers.attrs["min_num_soundings"], numbers.attrs["max_num_soundings"] = count.min(), count.max()
    return content.getvalue()


def _write(
    path: Path,
    layers: Sequence[NDArray[np.float32]],
    bathymetry: BathymetricMap,
    frame: Frame,
    vertical_datum: VerticalDatum,
    title: str,
    predicted: str,
) -> None:
    with rasterio.open(
        path,
        "w",
        driver="BAG",
        width=bathymetry.grid.cols,
        height=bathymetry.grid.rows,
        count=len(layers),
        dtype="float32",
        crs=CRS.from_wkt(frame.crs.to_wkt("WKT1_GDAL")),
        transform=north_up_transform(bathymetry),
        nodata=NODATA,
        VAR_VERT_WKT=vertical_datum.heights.to_wkt("WKT1_GDAL"),
        VAR_ABSTRACT=f"{title}. Elevations are minus the depth below {vertical_datum.statement}. "
        f"Uncertainty is {CHARTED_SD}. {predicted} {bathymetry.model}",
        VAR_INDIVIDUAL_NAME="bathyfleet",
        VAR_PROCESS_STEP_DESCRIPTION=f"Made of soundings: {bathymetry.model}",
    ) as file:
        for number, layer in enumerate(layers, start=1):
            file.write(layer, number)


def _holds(path: Path, layers: Sequence[NDArray[np.float32]]) -> bool:
    """Tell whether a file holds what was written: of a full disk the library says nothing when it closes it."""
    with rasterio.open(path) as file:
        return all(np.array_equal(file.read(number), layer) for number, layer in enumerate(layers, start=1))


def _predicted(bathymetry: BathymetricMap) -> str:
    """Return a sentence on the cells that have a depth and no sounding."""
    known = np.isfinite(bathymetry.depth_m)
    predicted = int((known & ~bathymetry.sounded).sum())
    if not predicted:
        return "Every cell with an elevation was sounded."
    return f"{predicted} of {int(known.sum())} cells with an elevation hold no sounding: there it is predicted."
