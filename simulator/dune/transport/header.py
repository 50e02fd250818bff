"""The header of IMC packets, in either byte order."""

from __future__ import annotations

import struct
from collections.abc import Sequence

_HEADER = struct.Struct("<HHHdHBHB")
_HEADER_BIG = struct.Struct(">HHHdHBHB")
_SYNC = 0xFE54


def read_header(data: bytes) -> tuple[int, int] | None:
    """Message id and source of a packet in either byte order, None where it is not IMC."""
    if len(data) < _HEADER.size + 2:
        return None
    fields: Sequence[int] = _HEADER.unpack_from(data)
    if fields[0] != _SYNC:
        fields = _HEADER_BIG.unpack_from(data)
        if fields[0] != _SYNC:
            return None
    return fields[1], fields[4]
