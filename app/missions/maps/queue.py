"""Soundings on their way into the map: noted on the event loop, taken in by the thread that makes the map."""

import threading
from collections import deque
from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray
from app.mapping.types import SoundingRows


@dataclass(frozen=True)
class Replacement:
    """Soundings that take the place of all that were there, and those that were imported.

    ``soundings`` None: the mission's own stay. ``trusted`` (n,) is True for those that are never taken for outliers.
    """

    soundings: SoundingRows | None
    prior: SoundingRows
    trusted: BoolArray


class Pending:
    """Stands for all soundings so far while they are being read."""


class MapQueue:
    """What came since the map was begun.

    Attributes
    ----------
    at_rest
        The mission's soundings are not in memory: nothing can be made of them before they are read.
    replaced
        How often soundings that were there were put in place of others.
    came, taken
        How many soundings came one by one, and how many of them were taken.
    """

    def __init__(self) -> None:
        self._queue: deque[SoundingRows | Replacement | Pending] = deque()
        self._lock = threading.Lock()
        self.at_rest = False
        self.replaced = 0
        self.came = self.taken = 0

    def __bool__(self) -> bool:
        """Tell whether anything came."""
        return bool(self._queue)

    def add(self, soundings: SoundingRows) -> None:
        """Note soundings."""
        if len(soundings):
            with self._lock:
                self._queue.append(soundings)
                self.came += len(soundings)

    def replace(self, soundings: SoundingRows, prior: SoundingRows, trusted: BoolArray | None = None) -> None:
        """Take these in place of all soundings so far; ``prior`` are those that were imported."""
        known = np.zeros(len(soundings), dtype=bool) if trusted is None else trusted
        with self._lock:
            self._queue.clear()
            self._queue.append(Replacement(soundings, prior, known))
            self.at_rest = False
            self.replaced += 1

    def replace_prior(self, prior: SoundingRows) -> None:
        """Take these in place of all imported soundings so far."""
        with self._lock:
            self._queue.append(Replacement(None, prior, np.zeros(0, dtype=bool)))
            self.replaced += 1

    def expect(self) -> Pending:
        """Await all soundings so far, imported ones too, which are about to be read; until then nothing is taken in."""
        coming = Pending()
        with self._lock:
            self._queue.clear()
            self._queue.append(coming)
            self.at_rest = True
            self.replaced += 1
        return coming

    def arrived(self, coming: Pending, everything: Replacement) -> None:
        """Take what was read for ``coming``, unless all is to be read once more."""
        with self._lock:
            if self._queue and self._queue[0] is coming:
                self._queue[0] = everything
                self.at_rest = False

    def rest(self) -> bool:
        """Leave the soundings where they are stored; not while anything is on its way. Tells whether it is so now."""
        with self._lock:
            self.at_rest = self.at_rest or not self._queue
            return self.at_rest

    def take(self) -> tuple[list[SoundingRows | Replacement], int] | None:
        """Return what came, and ``replaced`` as of that; None while the soundings are not in memory."""
        with self._lock:
            if self.at_rest:
                return None
            taken = [item for item in self._queue if not isinstance(item, Pending)]
            self._queue.clear()
            self.taken = self.came
            return taken, self.replaced

    def noted(self) -> list[SoundingRows]:
        """Return the soundings that came one by one."""
        return [item for item in self._queue.copy() if isinstance(item, np.ndarray)]
