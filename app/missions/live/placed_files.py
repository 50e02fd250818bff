"""Multibeams' own files that are being read, whose beams come placed."""

from collections.abc import Iterator
from contextlib import contextmanager


class PlacedFiles:
    """The files of one mission's vehicles that are being read."""

    def __init__(self) -> None:
        self._reading: list[tuple[str, str]] = []
        """Vehicles, and files of them."""

    @contextmanager
    def reading(self, file: str, vehicle: str) -> Iterator[None]:
        """Note that a file is being read."""
        self._reading.append((vehicle, file))
        try:
            yield
        finally:
            self._reading.remove((vehicle, file))

    def being_read(self, vehicle: str) -> set[str]:
        """Return the files of a vehicle that are being read."""
        return {file for own, file in self._reading if own == vehicle}
