"""Open connections, and which one makes room for another: idle ones of strangers first."""

from collections import Counter, OrderedDict
from collections.abc import Callable, Hashable
from enum import IntEnum
from typing import Generic, TypeVar

T = TypeVar("T", bound=Hashable)

SHARE = 4
"""An address of another machine may hold one part in so many."""


class Rank(IntEnum):
    """Who was the last to be served on a connection."""

    STRANGER = 0
    USER = 1
    OPERATOR = 2


class Sockets(Generic[T]):
    """Counts connections by address; of too many the one that was idle for longest leaves.

    Parameters
    ----------
    most
        Open connections.
    is_shared
        Tells whether many different people come from an address (this machine, a proxy), so that it has no share.
    """

    def __init__(self, most: int, is_shared: Callable[[str], bool]) -> None:
        self._most = most
        self._share = max(most // SHARE, 1)
        self._is_shared = is_shared
        self._host: dict[T, str] = {}
        self._held: Counter[str] = Counter()
        self._idle: dict[Rank, dict[str, OrderedDict[T, None]]] = {rank: {} for rank in Rank}
        self._rank: dict[T, Rank] = {}

    def __len__(self) -> int:
        return len(self._host)

    def opened(self, connection: T, host: str) -> T | None:
        """Take in a connection; return the one that has to be closed for it, maybe itself, and is counted no more."""
        leaver: T | None = None
        if self._held[host] >= self._share and not self._is_shared(host):
            leaver = self._longest_idle_of(host)
        if leaver is None and len(self._host) >= self._most:
            leaver = self._longest_idle()
            if leaver is None:
                return connection
        if leaver is not None:
            self.closed(leaver)
        self._host[connection] = host
        self._held[host] += 1
        self.idle(connection, Rank.STRANGER)
        return leaver

    def idle(self, connection: T, rank: Rank) -> None:
        """Note that a connection waits for a request from now on."""
        self.busy(connection)
        host = self._host.get(connection)
        if host is not None:
            self._rank[connection] = rank
            self._idle[rank].setdefault(host, OrderedDict())[connection] = None

    def busy(self, connection: T) -> None:
        """Note that a request is being answered: the connection makes room for nobody."""
        rank = self._rank.pop(connection, None)
        if rank is None:
            return
        host = self._host[connection]
        of_host = self._idle[rank][host]
        del of_host[connection]
        if not of_host:
            del self._idle[rank][host]

    def closed(self, connection: T) -> None:
        """Count a connection no more; safe to repeat."""
        self.busy(connection)
        host = self._host.pop(connection, None)
        if host is not None:
            self._held[host] -= 1
            if not self._held[host]:
                del self._held[host]

    def _longest_idle_of(self, host: str) -> T | None:
        for by_host in self._idle.values():
            if host in by_host:
                return next(iter(by_host[host]))
        return None

    def _longest_idle(self) -> T | None:
        for by_host in self._idle.values():
            if by_host:
                # Who holds the most of them has come in the greatest haste.
                return next(iter(by_host[max(by_host, key=lambda host: len(by_host[host]))]))
        return None
