"""The lines of a text file, a block at a time: how long a file is does not matter to memory."""

import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from app.mapping.readers.types import ReadError

BLOCK_BYTES = 1 << 19
MAX_LINE_BYTES = 4096
MAX_LINES = 20_000_000
MAX_TEXT_BYTES = 512 * 2**20
"""Of a packed file, unpacked."""


@dataclass(frozen=True)
class LineBlock:
    """Whole lines without their ends; ``first`` is the number of the first one, from 1."""

    first: int
    lines: list[str]


def blocks(file: BinaryIO, *, packed: bool) -> Iterator[LineBlock]:
    """Yield a text's lines; blocks in which there is nothing are left out.

    Raises
    ------
    ReadError
        For a line that is too long or no text in UTF-8, for too many lines, and for what cannot be unpacked.
    """
    first, rest = 1, b""
    for piece in _unpacked(file) if packed else iter(lambda: file.read(BLOCK_BYTES), b""):
        data = rest + piece
        # Up to the last end of a line; the very last byte may be the first half of \r\n.
        end = max(data.rfind(b"\n"), data.rfind(b"\r", 0, -1)) + 1
        rest = data[end:]
        lines = data[:end].splitlines()
        yield from _block(lines, first)
        first += len(lines)
        if len(rest) > MAX_LINE_BYTES:
            raise _too_long(first)
    yield from _block(rest.splitlines(), first)


def _block(lines: list[bytes], first: int) -> Iterator[LineBlock]:
    if first - 1 + len(lines) > MAX_LINES:
        raise ReadError("file", f"it has more than {MAX_LINES} lines", "split or thin the file")
    if not any(lines):
        return
    if len(max(lines, key=len)) > MAX_LINE_BYTES:
        raise _too_long(first + next(i for i, line in enumerate(lines) if len(line) > MAX_LINE_BYTES))
    text = b"\n".join(lines)
    try:
        yield LineBlock(first, text.decode().split("\n"))
    except UnicodeDecodeError as error:
        number = first + text.count(b"\n", 0, error.start)
        raise ReadError(f"line {number}", "it is not text in UTF-8", "send numbers as plain text") from None


def _too_long(number: int) -> ReadError:
    return ReadError(
        f"line {number}", f"it has more than {MAX_LINE_BYTES} bytes", "send one sounding a line, with few columns"
    )


def _unpacked(file: BinaryIO) -> Iterator[bytes]:
    """Yield what is in a gzip file, also one of several parts."""
    room = MAX_TEXT_BYTES
    stream = gzip.GzipFile(fileobj=file, mode="rb")
    try:
        while piece := stream.read1(BLOCK_BYTES):
            room -= len(piece)
            if room < 0:
                raise ReadError("file", "it is larger than 512 MiB unpacked", "send it in parts")
            yield piece
    except (EOFError, gzip.BadGzipFile, zlib.error):
        raise ReadError("file", "it is damaged or cut off, or not packed by gzip", "send it without .gz") from None
