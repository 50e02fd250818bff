"""A line to a service that can be cut, as a radio link is."""

import contextlib
import select
import socket
import threading
from collections.abc import Iterator


class Relay:
    """Passes bytes on to a port of this machine, until it is told to cut the line.

    Parameters
    ----------
    port : int
        Where it leads.
    """

    def __init__(self, port: int) -> None:
        self._to = port
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._lock = threading.Lock()
        self._open: set[socket.socket] = set()
        self.answers_to_lose = 0
        """So many answers arrive from the service and are lost on the way."""

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._listening.getsockname()[1]}"

    def cut(self) -> None:
        """End every connection that is open now."""
        with self._lock:
            for end in self._open:
                with contextlib.suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)

    def run(self) -> None:
        while True:
            try:
                near, _ = self._listening.accept()
            except OSError:
                return
            threading.Thread(target=self._pass_on, args=(near,), daemon=True).start()

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self.cut()

    def _pass_on(self, near: socket.socket) -> None:
        with near, socket.create_connection(("127.0.0.1", self._to)) as far:
            with self._lock:
                self._open |= {near, far}
            try:
                while True:
                    for end in select.select([near, far], [], [])[0]:
                        data = end.recv(65536)
                        if not data or (end is far and self._is_lost()):
                            return
                        (far if end is near else near).sendall(data)
            except OSError:
                return
            finally:
                with self._lock:
                    self._open -= {near, far}

    def _is_lost(self) -> bool:
        with self._lock:
            lost = self.answers_to_lose > 0
            self.answers_to_lose -= lost
            return lost


@contextlib.contextmanager
def relay_to(url: str) -> Iterator[Relay]:
    """A relay to the service at ``url``."""
    relay = Relay(int(url.rpartition(":")[2]))
    thread = threading.Thread(target=relay.run)
    thread.start()
    try:
        yield relay
    finally:
        relay.close()
        thread.join()
