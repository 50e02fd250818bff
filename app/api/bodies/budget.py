"""How many bytes of requests are under way at once, and how much of that is one client's."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from app.api.http.problems import ProblemError

RETRY_S = 5


class BodyBudget:
    """Bytes of bodies that are being received or worked on.

    Whoever has nothing under way gets what is free. Whoever has gets no more than half of what the others leave: so
    there is always something for one more.

    Parameters
    ----------
    total
        Bytes of all together.
    """

    def __init__(self, total: int) -> None:
        self.total = total
        self._held: Counter[str] = Counter()

    @property
    def held(self) -> int:
        """Bytes that are under way."""
        return self._held.total()

    @contextmanager
    def lease(self, client: str) -> Iterator["Lease"]:
        """Hold bytes for a client until the end of the block."""
        lease = Lease(self, client)
        try:
            yield lease
        finally:
            self._held[client] -= lease.held
            if not self._held[client]:
                del self._held[client]

    def take(self, client: str, count: int, first: bool) -> None:
        """Count bytes of a client. Raises ProblemError when there is no room for them."""
        own = self._held[client]
        free = self.total - self.held
        share = (self.total - (self.held - own)) // 2
        if count > free:
            raise ProblemError(
                "overloaded",
                f"{self.held} bytes of requests are under way, and {count} more are asked for; max_bytes_in_flight "
                f"allows {self.total}",
                remedy=f"Send it again after {RETRY_S} s",
                headers={"Retry-After": str(RETRY_S)},
            )
        if own + count > share and not (first and own == 0):
            raise ProblemError(
                "too-many-bytes",
                f"{own} bytes of {client!r} are under way already, and {count} more are asked for; {share} are its "
                "share of max_bytes_in_flight now",
                remedy="Send one after the other, each when the one before it was answered",
                headers={"Retry-After": str(RETRY_S)},
            )
        self._held[client] += count


@dataclass
class Lease:
    """Bytes that one request holds."""

    budget: BodyBudget
    client: str
    held: int = 0

    def cover(self, count: int) -> None:
        """Hold ``count`` bytes in all, or more. Raises ProblemError when there is no room."""
        if count > self.held:
            self.budget.take(self.client, count - self.held, self.held == 0)
            self.held = count
