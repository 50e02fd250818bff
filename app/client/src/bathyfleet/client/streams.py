"""What both clients share of their streams: where to go on, what is a message, when to give up."""

from __future__ import annotations

from typing import Annotated, get_args

import httpx
from httpx_sse import ServerSentEvent
from pydantic import Field, TypeAdapter
from pydantic_core import from_json
from websockets.exceptions import ConnectionClosed, InvalidStatus

from bathyfleet.client.call import part
from bathyfleet.client.models import EventView, LiveMessage, Problem
from bathyfleet.client.problems import (
    MEDIA_TYPE,
    BusyError,
    ProblemError,
    UnreachableError,
    made_up,
    raised,
)
from bathyfleet.client.retry import Attempts

ENDED = ("finished", "aborted", "failed")
QUIET_S = 45.0
"""The service says something at least every 15 s; a stream that is silent for longer is dead."""
LARGEST_MESSAGE = 64 << 20
REFUSALS = {
    4401: (401, "unauthenticated"),
    4403: (403, "forbidden"),
    4404: (404, "mission-not-found"),
    4429: (429, "too-many-streams"),
}
"""Codes that a live socket is closed with where it says why; HTTP status and kind of problem that say the same."""

_messages: TypeAdapter[LiveMessage] = TypeAdapter(Annotated[LiveMessage, Field(discriminator="type")])
_kinds = frozenset(get_args(message.model_fields["type"].annotation)[0] for message in get_args(LiveMessage))


class LogPlace:
    """How far a mission's log was read."""

    def __init__(self, mission_id: str, after: int) -> None:
        self._mission_id = mission_id
        self.newest = after

    @property
    def name(self) -> str:
        """What is read, for messages."""
        return f"events of mission {self._mission_id}"

    def request(self, client: httpx.Client | httpx.AsyncClient) -> httpx.Request:
        """Return the request that goes on after the newest entry."""
        return client.build_request(
            "GET",
            f"/api/v1/missions/{part(self._mission_id)}/events",
            headers={"Accept": "text/event-stream", "Last-Event-ID": str(self.newest)},
            timeout=httpx.Timeout(QUIET_S, connect=10.0),
        )

    def take(self, event: ServerSentEvent) -> EventView | None:
        """Return the entry that an event brings, if it is a new one."""
        if not event.data:
            return None
        entry = EventView.model_validate_json(event.data)
        if entry.id <= self.newest:
            return None
        self.newest = entry.id
        return entry


def ends(entry: EventView) -> bool:
    """Tell whether with this entry of its log a mission has ended."""
    return entry.kind == "state" and entry.data.get("state") in ENDED


def message_of(text: str | bytes) -> LiveMessage | None:
    """Return a message of a live socket; None for a kind that this client does not know."""
    value = from_json(text)
    return _messages.validate_python(value) if value.get("type") in _kinds else None


def refusal(error: Exception, name: str) -> ProblemError | None:
    """Return why a live socket is refused; None where nobody said. Of what is too much now, it may be had later."""
    if isinstance(error, ConnectionClosed) and error.rcvd is not None and error.rcvd.code in REFUSALS:
        status, kind = REFUSALS[error.rcvd.code]
        return raised(made_up(status, error.rcvd.reason, name, kind))
    if isinstance(error, InvalidStatus):
        answer = error.response
        if (answer.headers.get("content-type") or "").startswith(MEDIA_TYPE):
            return raised(Problem.model_validate_json(answer.body or b""))
        return raised(made_up(answer.status_code, "", name))
    return None


def wait_after(error: Exception, attempts: Attempts, name: str) -> float:
    """Return seconds to wait before a live socket is opened again. Raises why not: ProblemError, UnreachableError."""
    refused = refusal(error, name)
    if refused is None:
        return attempts.after_error(error)
    if not isinstance(refused, BusyError):
        raise refused from error
    try:
        return attempts.after_error(error)
    except UnreachableError:
        raise refused from error


def live_address(address: str, mission_id: str) -> str:
    """Return the address of a mission's live socket."""
    return f"ws{address.removeprefix('http')}/api/v1/missions/{part(mission_id)}/live"
