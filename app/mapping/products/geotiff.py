"""Map as single-file Cloud-Optimized GeoTIFF."""

from collections.abc import Sequence

import numpy as np
from affine import Affine
from rasterio.crs import CRS
from rasterio.io import MemoryFile

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import Frame
from app.mapping.layers import Layer
from app.mapping.types import BathymetricMap
from app.mapping.water.vertical import VerticalDatum

NODATA = -9999.0


def north_up_transform(bathymetry: BathymetricMap) -> Affine:
    """Return what takes column and row of a raster, north up, to east and north."""
    grid = bathymetry.grid
    return Affine(grid.cell_m, 0.0, grid.west_m, 0.0, -grid.cell_m, grid.south_m + grid.rows * grid.cell_m)


def geotiff(
    bathymetry: BathymetricMap, layers: Sequence[Layer], frame: Frame, *, vertical_datum: VerticalDatum
) -> bytes:
    """Return a COG with one band per layer, north up, in the frame with the vertical datum as its third axis.

    Its overviews hold values of single cells, so that none stands there that the map does not have: classes stay
    classes, and nothing is shoaler or surer than the map. They leave cells out: the least depth is told by the map.
    """
    grid = bathymetry.grid
    with MemoryFile() as memory:
        with memory.open(
            driver="COG",
            width=grid.cols,
            height=grid.rows,
            count=len(layers),
            dtype="float32",
            crs=CRS.from_wkt(vertical_datum.compound_with(frame.crs).to_wkt()),
            transform=north_up_transform(bathymetry),
            nodata=NODATA,
            compress="DEFLATE",
            predictor="YES",
            overview_resampling="NEAREST",
        ) as file:
            for number, layer in enumerate(layers, start=1):
                # Ground that was missed has no depth, and a density all the same.
                values = np.nan_to_num(layer.values, nan=NODATA).astype(np.float32)
                file.write(values[::-1], number)
                file.set_band_description(number, layer.name)
                file.set_band_unit(number, layer.unit)
                file.update_tags(number, MEANING=layer.meaning)
            file.update_tags(
                VERTICAL_DATUM=vertical_datum.statement,
                DEPTH_POSITIVE="down",
                MODEL=bathymetry.model,
                AREA_OR_POINT="Area",
                **_origin(frame),
                TIFFTAG_SOFTWARE="bathyfleet",
            )
        return bytes(memory.read())


def _origin(frame: Frame) -> dict[str, str]:
    """Return where a mission's own frame begins; what others know by its code needs no such statement."""
    if not isinstance(frame, LocalFrame):
        return {}
    return {"ORIGIN_LAT": repr(frame.origin_lat_deg), "ORIGIN_LON": repr(frame.origin_lon_deg)}
