"""Files that are there when they are complete."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from types import TracebackType
from typing import IO


class Arriving:
    """A file that takes its name at the end of a ``with`` statement that nothing interrupts.

    Parameters
    ----------
    path : path
        Its name; a file of that name is replaced then, and not before.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)

    def __enter__(self) -> IO[bytes]:
        handle, name = tempfile.mkstemp(dir=self._path.parent, prefix=f".{self._path.name}.")
        self._hidden = Path(name)
        self._file = os.fdopen(handle, "wb")
        return self._file

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._file.close()
        if kind is None:
            # Readable as any other file: the temporary one is its owner's alone.
            mask = os.umask(0)
            os.umask(mask)
            self._hidden.chmod(0o666 & ~mask)
            self._hidden.replace(self._path)
        else:
            self._hidden.unlink()
