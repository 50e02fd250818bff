"""Large jobs in pieces on all cores; the compiled loops and numpy release the interpreter's lock."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Piece = TypeVar("Piece")

MOST_THREADS = 8


def each(work: Callable[[Piece], None], pieces: Sequence[Piece]) -> None:
    """Do ``work`` on every piece; the pieces must not share what they write. A single piece needs no thread."""
    threads = min(len(pieces), os.cpu_count() or 1, MOST_THREADS)
    if threads <= 1:
        for piece in pieces:
            work(piece)
        return
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(work, pieces):
            pass
