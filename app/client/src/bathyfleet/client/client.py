"""The client for programs that wait for each answer."""

from __future__ import annotations

import ssl
import time
from collections.abc import Callable, Generator, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeAlias, TypeVar

import httpx
from httpx_sse import EventSource
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from bathyfleet.client.call import Call, part
from bathyfleet.client.connection import (
    ADDRESS,
    BATCH,
    PATIENCE_S,
    TIMEOUT_S,
    Item,
    authorization,
    batches,
    new_key,
    root,
    settings,
    together,
    trust,
)
from bathyfleet.client.files import Arriving
from bathyfleet.client.maps import dataset
from bathyfleet.client.models import (
    BatchVerdict,
    EventView,
    LiveMessage,
    MeasurementBatch,
    MissionState,
    MissionView,
    Order,
)
from bathyfleet.client.operations import Operations
from bathyfleet.client.pages import next_page
from bathyfleet.client.retry import Attempts
from bathyfleet.client.streams import (
    ENDED,
    LARGEST_MESSAGE,
    LogPlace,
    ends,
    live_address,
    message_of,
    wait_after,
)
from bathyfleet.client.wait import Wait

if TYPE_CHECKING:
    import xarray as xr

T = TypeVar("T")
Listing: TypeAlias = Callable[..., T]


class Client(Operations):
    """A service, with every operation of its REST interface as a method; used in a ``with`` statement.

    Parameters
    ----------
    address : str
        Where it answers, with or without ``/api/v1``.
    token : str, optional
        An access token, where the service has any.
    patience_s : float
        For how long requests that may be made twice are repeated while nobody answers or too much is under way.
    timeout_s : float
        The longest wait for an answer that has begun to be made.
    verify : bool or SSLContext
        How a certificate is checked; ``ssl.create_default_context(cafile=...)`` trusts an authority of your own.

    Raises
    ------
    ProblemError
        By all methods, when the service says why not: its subclasses are kinds of reasons.
    UnreachableError
        By all methods, when nobody answers, or with a certificate that is not trusted.
    """

    def __init__(
        self,
        address: str = ADDRESS,
        token: str | None = None,
        *,
        patience_s: float = PATIENCE_S,
        timeout_s: float = TIMEOUT_S,
        verify: bool | ssl.SSLContext = True,
    ) -> None:
        self._address = root(address)
        self._tls = trust(self._address, verify)
        self._http = httpx.Client(**settings(self._address, token, timeout_s, self._tls))
        self._token = token
        self._patience_s = patience_s

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def _call(self, call: Call[T]) -> T:
        attempts = self._attempts(f"{call.method} {call.path}", repeatable=call.repeatable, within_s=call.within_s)
        while True:
            try:
                answer = self._http.send(call.request(self._http, attempts.left_s))
            except httpx.TransportError as error:
                time.sleep(attempts.after_error(error))
                continue
            if answer.is_success:
                return call.read(answer)
            time.sleep(attempts.after_refusal(answer))

    def _attempts(self, what: str, *, repeatable: bool = True, within_s: float | None = None) -> Attempts:
        return Attempts(f"{what} at {self._address}", self._patience_s, repeatable=repeatable, within_s=within_s)

    def wait_for(
        self, mission_id: str, *states: MissionState, timeout_s: float | None = None, every_s: float = 1.0
    ) -> MissionView:
        """Return a mission as soon as it is in one of the states; without any named: when it has ended.

        Parameters
        ----------
        states : MissionState
            For example ``"running"``, ``"paused"``.
        timeout_s : float, optional
            The longest wait.
        every_s : float
            How often is asked.

        Raises
        ------
        EndedError
            When it has ended in another state: none of those can come any more.
        TimeoutError
            When the time is over.
        ValueError
            For a word that is no state.
        """
        wait = Wait(mission_id, states, timeout_s, every_s)
        while True:
            mission = self._call(wait.question())
            pause_s = wait.after(mission)
            if pause_s is None:
                return mission
            time.sleep(pause_s)

    def pages(self, listing: Listing[T], *arguments: Any, **query: Any) -> Generator[T, None, None]:
        """Yield all pages of a listing, one after the other: what an operation with ``after`` or ``before`` answers.

        Parameters
        ----------
        listing : callable
            The operation, for example :meth:`list_soundings` or :meth:`get_events`.
        arguments, query
            Its arguments; ``limit`` is how long a page is.
        """
        while True:
            page = listing(*arguments, **query)
            yield page
            following = next_page(page)
            if following is None:
                return
            query |= following

    def events(self, mission_id: str, *, after: int = 0, until_ended: bool = False) -> Generator[EventView, None, None]:
        """Yield the entries of a mission's log, first those that there are, then each as it is made.

        After an interruption it goes on where it was; no entry is missed or comes twice.

        Parameters
        ----------
        after : int
            Only entries with a larger id.
        until_ended : bool
            Stop after the entry that ends the mission, instead of never; where that one is not among
            those with a larger id any more, after the last one.
        """
        if until_ended and after and self.get_mission(mission_id).state in ENDED:
            for entries in self.pages(self.get_events, mission_id, after=after):
                for stored in entries:
                    yield stored
                    if ends(stored):
                        return
            return
        place = LogPlace(mission_id, after)
        attempts = self._attempts(place.name)
        while True:
            try:
                answer = self._http.send(place.request(self._http), stream=True)
                try:
                    if answer.is_success:
                        attempts.reached()
                        for event in EventSource(answer).iter_sse():
                            entry = place.take(event)
                            if entry is not None:
                                yield entry
                                if until_ended and ends(entry):
                                    return
                        wait_s = attempts.after_end()
                    else:
                        answer.read()
                        wait_s = attempts.after_refusal(answer)
                finally:
                    answer.close()
            except httpx.TransportError as error:
                wait_s = attempts.after_error(error)
            time.sleep(wait_s)

    def live(self, mission_id: str) -> Generator[LiveMessage, None, None]:
        """Yield what the live socket of a mission sends: a snapshot, then what changes.

        After an interruption it begins anew, with a snapshot.
        """
        address = live_address(self._address, mission_id)
        attempts = self._attempts(f"live messages of mission {mission_id}")
        while True:
            try:
                with connect(
                    address,
                    additional_headers=authorization(self._token),
                    max_size=LARGEST_MESSAGE,
                    ssl=self._tls,
                ) as socket:
                    for text in socket:
                        attempts.reached()
                        message = message_of(text)
                        if message is not None:
                            yield message
                wait_s = attempts.after_end()
            except (OSError, WebSocketException) as error:
                wait_s = wait_after(error, attempts, address)
            time.sleep(wait_s)

    def post_measurements(
        self,
        mission_id: str,
        body: MeasurementBatch | Mapping[str, Any],
        *,
        idempotency_key: str | None = None,
    ) -> BatchVerdict:
        """Post one batch of measurements, repeated under one key until it is answered: nothing is stored twice."""
        return super().post_measurements(mission_id, body, idempotency_key=idempotency_key or new_key())

    def send_measurements(self, mission_id: str, items: Iterable[Item], *, batch: int = BATCH) -> BatchVerdict:
        """Post any number of measurements, also pings of many beams, in batches; returns all verdicts, in order.

        Numbers and arrays may be NumPy's. ``batch`` is how many go at once at most; long ones go fewer at a time.
        Where it raises, the batches before are stored: sent again, their items are duplicates.
        """
        return together(self.post_measurements(mission_id, {"items": some}) for some in batches(items, batch))

    def map(self, mission_id: str, *, order: Order | None = None) -> xr.Dataset:
        """Return a mission's map as an xarray dataset with every layer; see :func:`bathyfleet.client.maps.dataset`.

        Parameters
        ----------
        order : str, optional
            The order of IHO S-44 that layers are compared with: ``special``, ``1a`` and so on.

        Raises
        ------
        NotFoundError
            While there is no map yet.
        ImportError
            Where xarray is missing.
        """
        return dataset(self.get_map_file(mission_id, "nc", order=order))

    def download(self, mission_id: str, name: str, path: str | Path, **query: Any) -> Path:
        """Store one of a mission's files, and return its path. The file is there when it is complete.

        Parameters
        ----------
        name : str
            For example ``map.tif``, ``report.pdf``, ``tracks.geojson``: see :meth:`list_products`.
        path : path
            Where it goes; what is there is replaced.
        query
            Further parameters of the request, such as ``order="special"``.
        """
        call: Call[bytes] = Call("GET", f"/missions/{part(mission_id)}/{part(name)}", bytes, query=query)
        attempts = self._attempts(f"{name} of mission {mission_id}")
        while True:
            try:
                answer = self._http.send(call.request(self._http), stream=True)
                try:
                    if answer.is_success:
                        with Arriving(path) as file:
                            for piece in answer.iter_bytes():
                                file.write(piece)
                        return Path(path)
                    answer.read()
                    wait_s = attempts.after_refusal(answer)
                finally:
                    answer.close()
            except httpx.TransportError as error:
                wait_s = attempts.after_error(error)
            time.sleep(wait_s)
