"""The log that DUNE keeps on board: every message that passes there, whether or not radio carries it."""

from __future__ import annotations

from pathlib import Path

FILE_NAME = "Data.lsf"


class LogBook:
    """One log file, IMC packets one after another.

    Parameters
    ----------
    folder
        Of the vehicle; each start of DUNE makes a folder of its own in it.
    started_s
        The vehicle's clock at its start, which names that folder.
    """

    def __init__(self, folder: Path, started_s: float) -> None:
        self.path = folder / f"{started_s:.3f}" / FILE_NAME
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._file = self.path.open("wb")

    def write(self, packet: bytes) -> None:
        """Append a packet; nothing once closed."""
        if not self._file.closed:
            self._file.write(packet)

    def close(self) -> None:
        """Write what is left; safe to repeat."""
        self._file.close()
