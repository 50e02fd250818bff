"""A Dask cluster as evaluations and training use it: many independent pieces of work, none lost with a worker."""

import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

T = TypeVar("T")

ATTEMPTS = 5
"""How often a piece of work is started again after its worker died."""

CONNECT_S = 15.0


class ClusterError(Exception):
    """The cluster cannot be used; ``str()`` says why and what to do."""


class RunCluster:
    """Workers behind a scheduler's address, ``tcp://HOST:PORT``."""

    def __init__(self, address: str) -> None:
        """Connect. Raises ClusterError when there is no scheduler, or none of its workers comes."""
        try:
            from distributed import Client
        except ImportError:
            raise ClusterError("--scheduler needs the package distributed: pip install 'bathyfleet[cluster]'") from None
        try:
            self._client = Client(address, timeout=CONNECT_S, set_as_default=False)
            self._client.wait_for_workers(1, timeout=CONNECT_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise ClusterError(
                f"no Dask cluster answers at {address!r} ({error or type(error).__name__}): "
                "start one by dask scheduler and dask worker, and name it as tcp://HOST:PORT"
            ) from error

    @property
    def threads(self) -> int:
        """Pieces of work that the workers do at the same time, as far as is known now."""
        return sum(self._client.nthreads().values())

    def share(self, what: Any) -> Any:
        """Give something to the workers that many pieces of work need; made again where a worker died with it."""
        return self._client.submit(pickle.loads, pickle.dumps(what), pure=True)

    def map(self, work: Callable[[Any, Any], T], shared: Any, pieces: Sequence[Any]) -> list[T]:
        """Return ``work(shared, piece)`` of every piece, in their order."""
        futures = self._client.map(work, [shared] * len(pieces), pieces, pure=False, retries=ATTEMPTS)
        return self._gather(futures)

    def imap(self, work: Callable[[Any], T], pieces: Sequence[Any]) -> Iterator[T]:
        """Yield ``work(piece)`` of every piece, in their order, each as soon as it is there."""
        futures = self._client.map(work, pieces, pure=False, retries=ATTEMPTS)
        for future in futures:
            yield self._gather([future])[0]

    def _gather(self, futures: list[Any]) -> list[Any]:
        """Wait for results. A piece that several workers died with is tried again: it need not be its fault."""
        from distributed import KilledWorker

        for attempt in range(ATTEMPTS):
            try:
                return list(self._client.gather(futures))
            except KilledWorker:
                if attempt == ATTEMPTS - 1:
                    raise
                for future in futures:
                    if future.status == "error":
                        future.retry()
                time.sleep(0.1)
        raise AssertionError

    def close(self) -> None:
        """Leave; the cluster goes on."""
        self._client.close()
