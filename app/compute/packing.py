"""Work and what came of it as bytes; large arrays are not copied on their way out."""

import pickle
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.arrays import ByteArray


@dataclass(frozen=True)
class Packed:
    """Something pickled: its structure, and the memory of its arrays."""

    head: bytes
    buffers: list[ByteArray]

    @property
    def size_bytes(self) -> int:
        """How much it is."""
        return len(self.head) + sum(buffer.nbytes for buffer in self.buffers)


def pack(content: Any) -> Packed:
    """Pickle something. Raises what pickle does where that cannot be."""
    buffers: list[pickle.PickleBuffer] = []
    head = pickle.dumps(content, pickle.HIGHEST_PROTOCOL, buffer_callback=buffers.append)
    return Packed(head, [np.frombuffer(buffer.raw(), np.uint8) for buffer in buffers])


def unpack(packed: Packed) -> Any:
    """Return what was packed; its arrays may be written to, as they could before.

    Compiled functions are other ones for arrays that may not: they would be compiled once more.
    """
    return pickle.loads(packed.head, buffers=[bytearray(buffer.data) for buffer in packed.buffers])  # noqa: S301


@dataclass(frozen=True)
class Raised:
    """An exception that work ended with; its class may be made of other arguments than it keeps."""

    kind: type[Exception]
    arguments: tuple[Any, ...]
    state: dict[str, Any]

    def error(self) -> Exception:
        """Return the exception as it was."""
        error = self.kind.__new__(self.kind)
        error.args = self.arguments
        error.__dict__.update(self.state)
        return error


def outcome(work: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> tuple[Any, Raised | None]:
    """Do work and return what came of it: its result and None, or None and what it raised."""
    try:
        return work(*arguments, **named), None
    except Exception as error:
        return None, Raised(type(error), error.args, error.__dict__)
