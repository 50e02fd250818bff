"""What is in a file that leaves the service, however large it is."""

import os
import weakref
from collections.abc import Iterator
from typing import IO

from app.storage.unnamed_file import unnamed_file

MEMORY_BYTES = 4_194_304
"""Up to here content is kept in memory."""
PIECE_BYTES = 262_144


class FileContent:
    """Content that grows piece by piece; beyond :data:`MEMORY_BYTES` it lies on disk. Several may read it at once.

    Raises OSError where the disk is full.
    """

    def __init__(self, content: bytes = b"") -> None:
        # What is in memory as a whole stays there.
        self._kept: bytes | bytearray | None = content
        self._file: IO[bytes] | None = None
        self.size_bytes = len(content)

    @classmethod
    def of_file(cls, file: IO[bytes]) -> "FileContent":
        """Return what was written into a file, which is closed when nobody needs the content any more."""
        content = cls()
        content._kept, content._file, content.size_bytes = None, file, file.seek(0, os.SEEK_END)
        weakref.finalize(content, file.close)
        return content

    def add(self, piece: bytes) -> None:
        """Append a piece."""
        self.size_bytes += len(piece)
        if self._kept is not None:
            self._kept = bytearray(self._kept) if isinstance(self._kept, bytes) else self._kept
            self._kept += piece
            piece = b""
            if self.size_bytes > MEMORY_BYTES:
                self._file = unnamed_file()
                weakref.finalize(self, self._file.close)
                piece, self._kept = bytes(self._kept), None
        if self._file is not None:
            self._file.write(piece)

    def pieces(self) -> Iterator[bytes]:
        """Yield the content from its beginning."""
        if self._file is not None:
            self._file.flush()
        for at in range(0, self.size_bytes, PIECE_BYTES):
            if self._file is not None:
                yield os.pread(self._file.fileno(), PIECE_BYTES, at)
            elif self._kept is not None:
                yield bytes(self._kept[at : at + PIECE_BYTES])

    def whole(self) -> bytes:
        """Return all of it, where that is known to be small."""
        return b"".join(self.pieces())

    def __reduce__(self) -> tuple[type["FileContent"], tuple[bytes]]:
        return FileContent, (self.whole(),)
