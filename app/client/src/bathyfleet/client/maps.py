"""A map as xarray, which is only imported when a map is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr


def dataset(content: bytes) -> xr.Dataset:
    """Return a mission's NetCDF file as a dataset in memory.

    Returns
    -------
    xarray.Dataset
        A variable for each layer over ``y`` and ``x``, metres north and east of the mission's origin; ``lat`` and
        ``lon`` of each cell; NaN where nothing is known.

    Raises
    ------
    ImportError
        Where xarray is missing.
    """
    try:
        import xarray as xr
        from netCDF4 import Dataset
    except ImportError as error:
        raise ImportError("maps need xarray and netCDF4: pip install 'bathyfleet[client]'") from error
    file = xr.backends.NetCDF4DataStore(Dataset("map.nc", memory=content))  # type: ignore[no-untyped-call]
    with xr.open_dataset(file) as found:
        return found.load()
