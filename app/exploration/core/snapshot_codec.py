"""Planners' memories as bytes: JSON with exact floating-point numbers."""

from typing import Any

import numpy as np
import orjson

VERSION = 1


def pack(kind: str, memory: dict[str, Any]) -> bytes:
    """Return the memory (numbers, strings, lists, dicts and arrays) of a planner of this kind."""
    document = {"kind": kind, "version": VERSION, "memory": memory}
    return orjson.dumps(document, default=_scattered, option=orjson.OPT_SERIALIZE_NUMPY)


def _scattered(value: object) -> Any:
    """Return an array as a list that orjson does not take itself: part of a larger one, its rows apart in memory."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"a planner's memory holds {type(value).__name__}; it may hold numbers, strings, lists, arrays")


def unpack(kind: str, data: bytes) -> dict[str, Any]:
    """Return what :func:`pack` was given, arrays as lists. Raises ValueError when the bytes are something else."""
    try:
        document = orjson.loads(data)
    except orjson.JSONDecodeError as error:
        raise ValueError(f"planner memory is not JSON: {error}") from error
    if not isinstance(document, dict) or document.get("version") != VERSION:
        raise ValueError(f"planner memory has no version {VERSION}; it was written by another release")
    if document.get("kind") != kind:
        raise ValueError(f"planner memory belongs to planner {document.get('kind')!r}, not {kind!r}")
    memory = document.get("memory")
    if not isinstance(memory, dict):
        raise ValueError("planner memory holds no field 'memory'")
    return memory
