"""HDF5 that keeps to itself: nothing in it that stands for what is elsewhere (NetCDF-4 and BAG are HDF5)."""

import io

import h5py

from app.mapping.readers.types import ReadError

MAX_OBJECTS = 10_000
FILTERS = {
    h5py.h5z.FILTER_DEFLATE,
    h5py.h5z.FILTER_SHUFFLE,
    h5py.h5z.FILTER_FLETCHER32,
    h5py.h5z.FILTER_SZIP,
    h5py.h5z.FILTER_NBIT,
    h5py.h5z.FILTER_SCALEOFFSET,
}
"""Compression and checksums that are part of HDF5. Others would be loaded from libraries on this machine."""

_UNREADABLE = (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError)


def check_contained(content: bytes) -> None:
    """Refuse what leads out of a file: external storage, links, virtual data, filters that are loaded.

    HDF5 would open other files of this machine in its name.

    Raises
    ------
    ReadError
        When there is any of it, or the content is no HDF5.
    """
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            _check(file.id)
    except _UNREADABLE:
        raise ReadError("file", "it cannot be read as HDF5", "send a file that is whole") from None


def _check(file: "h5py.h5f.FileID") -> None:
    names: list[bytes] = []
    links = set()

    def note(name: bytes, link: "h5py.h5l.LinkInfo") -> bool | None:
        names.append(name)
        links.add(link.type)
        return True if len(names) > MAX_OBJECTS else None

    file.links.visit(note, info=True)
    if len(names) > MAX_OBJECTS:
        raise ReadError("file", f"it has more than {MAX_OBJECTS} groups and variables", "send the grid alone")
    if links - {h5py.h5l.TYPE_HARD}:
        raise ReadError("file", "it has links to other places", "write its variables into the file itself")
    for name in names:
        dataset = h5py.h5o.open(file, name)
        if isinstance(dataset, h5py.h5d.DatasetID):
            _check_dataset(dataset)


def _check_dataset(dataset: "h5py.h5d.DatasetID") -> None:
    stored = dataset.get_create_plist()
    if stored.get_external_count():
        raise ReadError("file", "a variable of it is stored in another file", "write its values into the file itself")
    if stored.get_layout() == h5py.h5d.VIRTUAL:
        raise ReadError("file", "a variable of it is put together from others", "write its values into the file itself")
    filters = {stored.get_filter(index)[0] for index in range(stored.get_nfilters())}
    if filters - FILTERS:
        raise ReadError("file", "it is packed in a way that is not part of HDF5", "pack it by deflate (zlib)")
