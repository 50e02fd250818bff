"""Map as Bathymetric Attributed Grid (BAG 1.6), the exchange format of hydrographic offices."""

import io
import tempfile
from pathlib import Path

import h5py
import numpy as np
import rasterio
from rasterio.crs import CRS

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.products.geotiff import north_up_transform
from app.mapping.types import BathymetricMap
from app.mapping.water.vertical import VerticalDatum

NODATA = 1_000_000.0
"""What the format prescribes for cells without a value."""


def bag(bathymetry: BathymetricMap, frame: LocalFrame, *, vertical_datum: VerticalDatum, title: str) -> bytes:
    """Return a BAG with elevation (positive up: minus the depth), its standard deviation and numbers of soundings.

    The vertical datum stands in the metadata; the library would call it unknown.
    """
    grid = bathymetry.grid
    layers = [
        np.where(np.isfinite(layer), layer, NODATA).astype(np.float32)[::-1]
        for layer in (-bathymetry.depth_m, bathymetry.sd_m)
    ]
    # HDF5 writes to real files only.
    with tempfile.TemporaryDirectory(prefix="bathyfleet-") as folder:
        path = Path(folder) / "map.bag"
        with rasterio.open(
            path,
            "w",
            driver="BAG",
            width=grid.cols,
            height=grid.rows,
            count=len(layers),
            dtype="float32",
            crs=CRS.from_wkt(frame.crs.to_wkt("WKT1_GDAL")),
            transform=north_up_transform(bathymetry),
            nodata=NODATA,
            VAR_VERT_WKT=vertical_datum.crs.to_wkt("WKT1_GDAL"),
            VAR_ABSTRACT=f"{title}. Elevations are minus the depth below {vertical_datum.statement}. "
            f"Uncertainty is one standard deviation. {bathymetry.model}",
            VAR_INDIVIDUAL_NAME="bathyfleet",
            VAR_PROCESS_STEP_DESCRIPTION=f"Made of soundings: {bathymetry.model}",
        ) as file:
            for number, layer in enumerate(layers, start=1):
                file.write(layer, number)
        content = io.BytesIO(path.read_bytes())
    with h5py.File(content, "r+") as file:
        count = np.where(np.isfinite(bathymetry.depth_m), bathymetry.count, 0).astype("<u4")
        numbers = file["BAG_root"].create_dataset("num_soundings", data=count, chunks=True, compression="gzip")
        numbers.attrs["min_num_soundings"], numbers.attrs["max_num_soundings"] = count.min(), count.max()
    return content.getvalue()
