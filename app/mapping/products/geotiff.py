"""Map as single-file Cloud-Optimized GeoTIFF."""

import numpy as np
from affine import Affine
from rasterio.crs import CRS
from rasterio.io import MemoryFile

from app.mapping.georeference import LocalFrame
from app.mapping.types import BathymetricMap

NODATA = -9999.0

BANDS = (
    ("depth", "depth below the vertical datum, positive down", "metre"),
    ("uncertainty", "standard deviation of the depth", "metre"),
    ("count", "soundings in the cell", "1"),
    ("sounded", "1 sounded, 0 interpolated", "1"),
)


def geotiff(bathymetry: BathymetricMap, frame: LocalFrame, *, vertical_datum: str) -> bytes:
    """Return a COG with the bands depth, uncertainty, count and sounded, north up, in the local frame.

    Parameters
    ----------
    vertical_datum
        What depths are counted from, as stated in the tags, for instance ``EPSG:5861 (lowest astronomical
        tide)``.
    """
    grid = bathymetry.grid
    outside = ~np.isfinite(bathymetry.depth_m)
    layers = [
        np.where(outside, NODATA, np.nan_to_num(layer, nan=NODATA)).astype(np.float32)
        for layer in (bathymetry.depth_m, bathymetry.sd_m, bathymetry.count, bathymetry.sounded)
    ]
    north_m = grid.south_m + grid.rows * grid.cell_m
    with MemoryFile() as memory:
        with memory.open(
            driver="COG",
            width=grid.cols,
            height=grid.rows,
            count=len(BANDS),
            dtype="float32",
            crs=CRS.from_wkt(frame.crs_wkt),
            transform=Affine(grid.cell_m, 0.0, grid.west_m, 0.0, -grid.cell_m, north_m),
            nodata=NODATA,
            compress="DEFLATE",
            predictor="YES",
        ) as file:
            for number, (layer, (name, meaning, unit)) in enumerate(zip(layers, BANDS, strict=True), start=1):
                file.write(layer[::-1], number)
                file.set_band_description(number, name)
                file.set_band_unit(number, unit)
                file.update_tags(number, MEANING=meaning)
            file.update_tags(
                VERTICAL_DATUM=vertical_datum,
                DEPTH_POSITIVE="down",
                MODEL=bathymetry.model,
                AREA_OR_POINT="Area",
                ORIGIN_LAT=repr(frame.origin_lat_deg),
                ORIGIN_LON=repr(frame.origin_lon_deg),
                TIFFTAG_SOFTWARE="bathyfleet",
            )
        return bytes(memory.read())
