"""Grids that stand for what is in other files of the machine that reads them."""

import io
from pathlib import Path

import h5py
import numpy as np

LAT = 41.1850 + 1e-5 * np.arange(8)
LON = -8.7050 + 1e-5 * np.arange(8)
SECRET = b"5.25 QXZ7 vK1b WJ9q 4hYt RmP0 zzLf 8cDn UgE3 oBs6 XiA2 kVw5 yTh1 "
"""As bytes they could be depths, and as text its beginning could be one."""


def told(text: str) -> bool:
    """Whether a piece of the secret or of a private file's name is in a text."""
    secret = SECRET.decode()
    return any(secret[i : i + 6] in text for i in range(len(secret) - 6)) or "private" in text


def private_file(folder: Path) -> Path:
    """Something that only the service's user may read."""
    path = folder / "private.key"
    path.write_bytes(SECRET)
    path.chmod(0o600)
    return path


def private_hdf5(folder: Path) -> Path:
    """The same as a grid in HDF5."""
    path = folder / "private.h5"
    with h5py.File(path, "w") as file:
        file["depth"] = _values()
        file["uncertainty"] = np.full((8, 8), 0.5, "f4")
    path.chmod(0o600)
    return path


def _values() -> np.ndarray:
    return np.frombuffer(SECRET[:64], "u1").reshape(8, 8).astype("f4")


def _axes(file: h5py.File) -> None:
    for name, values in (("lat", LAT), ("lon", LON)):
        file[name] = values
        file[name].make_scale(name)


def _attach(dataset: h5py.Dataset) -> None:
    for axis, name in enumerate(("lat", "lon")):
        dataset.dims[axis].attach_scale(dataset.file[name])


def grids(folder: Path) -> dict[str, bytes]:
    """Each kind of way out, by the name of the file."""
    key, other = private_file(folder), private_hdf5(folder)
    found: dict[str, bytes] = {}
    for name in ("external", "external_relative", "external_link", "virtual", "soft_link", "filter"):
        content = io.BytesIO()
        with h5py.File(content, "w") as file:
            _axes(file)
            if name == "external_link":
                file["depth"] = h5py.ExternalLink(str(other), "depth")
            elif name == "soft_link":
                file["elsewhere"] = h5py.ExternalLink(str(other), "/")
                file["depth"] = h5py.SoftLink("/elsewhere/depth")
            elif name == "virtual":
                layout = h5py.VirtualLayout((8, 8), "f4")
                layout[:] = h5py.VirtualSource(str(other), "depth", (8, 8))
                _attach(file.create_virtual_dataset("depth", layout))
            elif name == "filter":
                _unknown_filter(file)
                _attach(file["depth"])
            else:
                place = str(key) if name == "external" else f"../../../../../../../..{key}"
                _attach(file.create_dataset("depth", (8, 8), "u1", external=[(place, 0, 64)]))
        found[f"{name}.nc"] = content.getvalue()
    return found | _texts(key) | {"named_grid.nc": _wkt_grid(key)}


def _unknown_filter(file: h5py.File) -> None:
    stored = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    stored.set_chunk((8, 8))
    stored.set_filter(32015, h5py.h5z.FLAG_OPTIONAL, ())
    h5py.h5d.create(file.id, b"depth", h5py.h5t.IEEE_F32LE, h5py.h5s.create_simple((8, 8)), stored)


def _texts(key: Path) -> dict[str, bytes]:
    virtual = (
        '<VRTDataset rasterXSize="8" rasterYSize="8"><SRS>EPSG:4326</SRS>'
        "<GeoTransform>-8.705,1e-5,0,41.186,0,-1e-5</GeoTransform>"
        '<VRTRasterBand dataType="Byte" band="1" subClass="VRTRawRasterBand">'
        f'<SourceFilename relativetoVRT="0">{key}</SourceFilename><ImageOffset>0</ImageOffset>'
        "<PixelOffset>1</PixelOffset><LineOffset>8</LineOffset></VRTRasterBand></VRTDataset>"
    ).encode()
    grid = "ncols 8\nnrows 8\nxllcorner -8.705\nyllcorner 41.185\ncellsize 1e-5\n"
    return {
        "virtual.tif": virtual,
        "virtual.asc": virtual,
        "remote.tif": b"/vsicurl/http://127.0.0.1:9/a.tif",
        "named.asc": f"{grid}{key}\n".encode(),
        "document.csv": f"lon,lat,depth\n-8.7049,41.1851,@{key}\n".encode(),
        "include.xyz": f'#include "{key}"\n/vsizip/{key}\n'.encode(),
        "entity.bag": f'<!DOCTYPE a [<!ENTITY b SYSTEM "file://{key}">]><a>&b;</a>'.encode(),
    }


def _wkt_grid(key: Path) -> bytes:
    """A reference system whose shift to WGS 84 is in a file: PROJ would open it."""
    wkt = (
        'BOUNDCRS[SOURCECRS[GEOGCRS["x",DATUM["x",ELLIPSOID["Bessel 1841",6377397.155,299.1528128]],'
        'CS[ellipsoidal,2],AXIS["latitude",north],AXIS["longitude",east],ANGLEUNIT["degree",0.0174532925199433]]],'
        'TARGETCRS[GEOGCRS["WGS 84",DATUM["World Geodetic System 1984",ELLIPSOID["WGS 84",6378137,298.257223563]],'
        'CS[ellipsoidal,2],AXIS["latitude",north],AXIS["longitude",east],ANGLEUNIT["degree",0.0174532925199433]]],'
        'ABRIDGEDTRANSFORMATION["x",METHOD["NTv2",ID["EPSG",9615]],'
        f'PARAMETERFILE["Latitude and longitude difference file","{key}"]]]'
    )
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        _axes(file)
        file["crs"] = 0
        file["crs"].attrs["crs_wkt"] = wkt
        file["depth"] = np.full((8, 8), 5.0, "f4")
        file["depth"].attrs["grid_mapping"] = "crs"
        _attach(file["depth"])
    return content.getvalue()
