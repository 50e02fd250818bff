"""Files that mean harm, and a process with little memory to read them.

``python -m tests.support.faults.hostile READER DIR``: READER is ``terrain`` or ``soundings``. Prints one JSON object:
each file's name with what it was refused with, "" where it was read; any other error ends the process with its
traceback.
"""

import gzip
import io
import json
import resource
import struct
import sys
import zipfile
from pathlib import Path

import numpy as np

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.types import MapExtent
from app.mapping.types import Grid

PLACE = MapExtent(LocalFrame(41.0, -8.0), Grid(0.0, 0.0, 2.0, 20, 20), 10.0)
MEMORY_BYTES = 2 * 2**30
HUGE = 10**6
"""Of 10^6 by 10^6 cells there are 10^12."""


def npz(**members: bytes) -> bytes:
    """An archive of arrays given as the bytes of their files."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return packed.getvalue()


def npy(array: np.ndarray) -> bytes:
    """An array's file."""
    content = io.BytesIO()
    np.save(content, array, allow_pickle=True)
    return content.getvalue()


def npy_header(shape: str, kind: str = "<f8") -> bytes:
    """The beginning of an array's file, which claims any shape."""
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}"
    text = text.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


CELL = npy(np.array(2.0))
GSF_BEGIN = struct.pack(">II", 12, 1) + b"GSF-v03.09\0\0"


def terrains() -> dict[str, bytes]:
    """Terrain files that cannot be used, by name."""
    zeros = gzip.compress(bytes(2**20)) * 3000  # 3 GB of zeros in 3 MB
    names = "ncols {0}\nnrows {1}\nxllcorner 0\nyllcorner 0\ncellsize {2}\n1 2\n3 4\n"
    return {
        "huge_header.npz": npz(z=npy_header(f"({HUGE}, {HUGE})"), cell_m=CELL),
        "negative.npz": npz(z=npy_header("(-5, 5)"), cell_m=CELL),
        "overflow.npz": npz(z=npy_header(f"({2**62}, {2**62})"), cell_m=CELL),
        "bomb.npz": npz(z=npy_header("(40000, 40000)") + bytes(2**28), cell_m=CELL),
        "huge_scalar.npz": npz(z=npy(np.ones((4, 4))), cell_m=npy_header(f"({HUGE}, {HUGE})")),
        "pickle.npz": npz(z=npy(np.array([[{"a": 1}, 2], [3, 4]], dtype=object)), cell_m=CELL),
        "text.npz": npz(z=npy(np.array([["a", "b"], ["c", "d"]])), cell_m=CELL),
        "nan_cell.npz": npz(z=npy(np.ones((4, 4))), cell_m=npy(np.array(np.nan))),
        "zero_cell.npz": npz(z=npy(np.ones((4, 4))), cell_m=npy(np.array(0.0))),
        "three_dimensions.npz": npz(z=npy(np.ones((4, 4, 4))), cell_m=CELL),
        "not_a_zip.npz": b"PK\x03\x04" + bytes(100),
        "member_is_rubbish.npz": npz(z=b"rubbish", cell_m=CELL),
        "huge.asc": names.format(HUGE, HUGE, 2).encode(),
        "infinite.asc": names.format("1e400", 2, 2).encode(),
        "no_number.asc": names.format("nan", 2, 2).encode(),
        "negative.asc": names.format(-2, -2, 2).encode(),
        "zero_cell.asc": names.format(2, 2, 0).encode(),
        "nan_cell.asc": names.format(2, 2, "nan").encode(),
        "rubbish.asc": bytes(range(256)) * 4,
        "bomb.asc.gz": zeros,
        "bomb.xyz.gz": zeros,
        "not_packed.xyz.gz": b"1 2 3\n",
        "cut_off.xyz.gz": gzip.compress(b"1 2 3\n" * 1000)[:40],
        "enormous.xyz": b"0 0 1\n1e308 0 2\n0 1e308 3\n-1e308 5 4\n",
        "minute.xyz": b"0 0 1\n1e-320 0 2\n0 1e-320 3\n1e-320 1e-320 4\n",
        "one_place.xyz": b"1 1 1\n1 1 2\n1 1 3\n",
        "one_line.xyz": b"0 0 1\n1 1 2\n2 2 3\n3 3 4\n",
        "nothing.xyz": b"",
        "nul.csv": b"x,y,z\n\x00,1,2\n",
        "beyond.csv": b"lat,lon,depth_m\n95,0,1\n96,1,2\n97,2,3\n",
        "world.csv": b"lat,lon,depth_m\n-80,-179,1\n80,179,2\n0,0,3\n",
        "virtual.tif": b'<VRTDataset rasterXSize="4" rasterYSize="4"><VRTRasterBand dataType="Float32" band="1">'
        b"<SimpleSource><SourceFilename>/etc/passwd</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>",
        "cut_off.tif": b"II*\x00\x08\x00\x00\x00",
        "rubbish.tif": b"II*\x00" + bytes(range(256)) * 8,
        "huge.tif": sparse_tif(),
    }


def soundings() -> dict[str, bytes]:
    """Files for an import that cannot be used, by name."""
    found = terrains()
    kept = {name: content for name, content in found.items() if not name.endswith((".npz", ".asc.gz"))}
    # Soundings that can be read, wherever they are then found to lie, and grids of which GDAL makes something.
    for name in ("one_place", "one_line", "minute", "enormous"):
        del kept[f"{name}.xyz"]
    for name in ("zero_cell", "nan_cell", "negative", "infinite"):
        del kept[f"{name}.asc"]
    del kept["world.csv"], kept["beyond.csv"]
    kept |= {
        "huge.nc": huge_netcdf(),
        "rubbish.nc": b"\x89HDF\r\n\x1a\n" + bytes(range(256)) * 8,
        "cut_off.nc": b"CDF\x01",
        "classic_huge.nc": b"CDF\x01" + struct.pack(">i", 0x7FFFFFFF) * 40,
        "rubbish.bag": b"\x89HDF\r\n\x1a\n" + bytes(range(256)) * 8,
        "text.bag": b"not a bag",
        "one_long_line.csv": b"x,y,z\n" + b"a," * 2**20,
        "many_columns.csv": b"x,y,z" + b",a" * 10**5 + b"\nnan,1,2\n",
        "infinite.csv": b"x,y,z\n1,2,inf\n",
        "huge_record.gsf": GSF_BEGIN + struct.pack(">II", 2**32 - 4, 2) + bytes(2**20),
        "endless.gsf": GSF_BEGIN + struct.pack(">II", 2**32 - 4, 12) + bytes(2**20),
        "zeros.gsf": GSF_BEGIN + bytes(2**22),
        "many_small.gsf": GSF_BEGIN + struct.pack(">III", 4, 12, 0) * 10**5,
        "huge_datagram.kmall": struct.pack("<I4s12x", 2**32 - 1, b"#MRZ") + bytes(2**20),
        "endless.kmall": struct.pack("<I4s12x", 2**32 - 1, b"#MWC") + bytes(2**20),
        "many_small.kmall": struct.pack("<I4s12xI", 24, b"#SPO", 24) * 10**5,
        "rubbish.kmall": bytes(range(256)) * 8,
        "rubbish.gsf": bytes(range(256)) * 8,
    }
    return kept


def sparse_tif() -> bytes:
    """A few bytes that claim 10^12 cells."""
    # Tags: width, length, bits, compression, photometric, offset of the strip, samples, rows per strip, its length.
    tags = [(256, 4, HUGE), (257, 4, HUGE), (258, 3, 32), (259, 3, 1), (262, 3, 1), (273, 4, 8), (277, 3, 1)]
    tags += [(278, 4, HUGE), (279, 4, 16)]
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    return b"II*\x00" + struct.pack("<IH", 8, len(tags)) + entries + bytes(4)


def huge_netcdf() -> bytes:
    """NetCDF whose variable has 10^12 cells, of which none is written."""
    from netCDF4 import Dataset

    file = Dataset("huge.nc", "w", memory=1 << 16)
    for name in ("y", "x"):
        file.createDimension(name, HUGE)
        file.createVariable(name, "f8", (name,), chunksizes=(1000,))
    file.createVariable("depth", "f4", ("y", "x"), chunksizes=(1000, 1000))
    return bytes(file.close())


def read(reader: str, path: Path) -> str:
    """What a file was refused with; empty when it was read."""
    if reader == "terrain":
        from simulator.floors.terrain import TerrainError
        from simulator.floors.terrain_files import load_terrain

        try:
            load_terrain(path)
        except TerrainError as error:
            return str(error)
        return ""
    from app.mapping.readers.file_extensions import ending
    from app.mapping.readers.reader_choice import read_file
    from app.mapping.readers.types import ReadError

    try:
        with path.open("rb") as file:
            read_file(file, ending(path.name), PLACE)
    except ReadError as error:
        return f"{error.field}: {error}; {error.remedy}"
    return ""


def main() -> None:
    """Write the files, limit the memory, read them."""
    reader, folder = sys.argv[1], Path(sys.argv[2])
    files = terrains() if reader == "terrain" else soundings()
    for name, content in files.items():
        (folder / name).write_bytes(content)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    sys.stdout.write(json.dumps({name: read(reader, folder / name) for name in files}))


if __name__ == "__main__":
    main()
