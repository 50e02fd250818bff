"""What a mission does, as it happens: the log as server-sent events, everything over a WebSocket."""

import asyncio
import sqlite3
from collections import OrderedDict
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing
from typing import Annotated

import anyio
import structlog
from fastapi import APIRouter, Header, Query, Request, Response, WebSocket, WebSocketDisconnect
from pydantic import TypeAdapter
from sqlalchemy.exc import SQLAlchemyError
from sse_starlette import EventSourceResponse, ServerSentEvent
from starlette.types import Receive, Scope, Send

from app.api.access.auth import Reader, authenticate, until_unwelcome
from app.api.http import close_codes
from app.api.http.first_completed import first_of
from app.api.http.problems import ProblemError, problems
from app.api.mission import Mission
from app.api.schemas import API, is_mission_id
from app.api.state import EdgeState, State, edge_state
from app.missions.errors import MissionElsewhereError, MissionError, MissionNotFoundError, NotAMemberError
from app.missions.live.watchers.broadcast import WatchEndedError
from app.missions.operations.history import events_after
from app.missions.running.mission_views import followed, watched
from app.missions.views.messages import EventMessage, LiveMessage, SnapshotMessage
from app.missions.views.mission import EventView
from app.storage.db_errors import trouble_of

router = APIRouter(prefix=f"{API}/missions/{{mission_id}}", tags=["live"])

PAGE = 500
KEEP_ALIVE_S = 15
KEPT_TEXTS = 64
RECONNECT_MS = 2000

log = structlog.get_logger(__name__)

_events = TypeAdapter(list[EventView])
_message: TypeAdapter[LiveMessage] = TypeAdapter(LiveMessage)
_texts: OrderedDict[int, tuple[LiveMessage, str]] = OrderedDict()


@router.get(
    "/events",
    operation_id="getEvents",
    summary="Follow or read a mission's log",
    responses=problems(
        "unauthenticated", "forbidden", "mission-not-found", "not-acceptable", "invalid-request", "too-many-streams"
    )
    | {
        200: {
            "description": "The log: as a stream (`text/event-stream`, also when anything is accepted) that replays "
            "what is newer than `Last-Event-ID` and then goes on, or as a list (`application/json`)",
            "content": {
                "application/json": {"schema": {"type": "array", "items": {"$ref": "#/components/schemas/EventView"}}},
                "text/event-stream": {
                    "schema": {
                        "type": "string",
                        "description": "Events whose id is the entry's id, whose name is its kind and whose data is an "
                        "EventView as JSON",
                    }
                },
            },
        }
    },
    response_class=Response,
)
async def get_events(
    request: Request,
    state: State,
    reader: Reader,
    mission: Mission,
    last_event_id: Annotated[
        int | None, Header(ge=0, lt=2**62, description="Id of the newest entry that the client has")
    ] = None,
    after: Annotated[
        int, Query(ge=0, lt=2**62, description="Only entries with a larger id, like `Last-Event-ID`, which is stronger")
    ] = 0,
    limit: Annotated[int, Query(ge=1, le=1000, description="Most entries in a list")] = 1000,
) -> Response:
    """Return the mission's log, oldest entry first."""
    start = after if last_event_id is None else last_event_id
    if _wants_list(request.headers.get("accept", "*/*")):
        entries = await events_after(mission, start, limit)
        return Response(_events.dump_json(entries), media_type="application/json")
    return _EventStream(state, mission.id, start, request)


class _EventStream(EventSourceResponse):
    """The log as a stream. It counts as a live view from before its first byte: one too many gets a problem instead."""

    def __init__(self, state: EdgeState, mission_id: str, start: int, request: Request) -> None:
        super().__init__(
            _stream(state, mission_id, start, request),
            ping=KEEP_ALIVE_S,
            headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
        )
        self._view = state.stream("sse", request)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer. Raises ProblemError where all live views are taken."""
        with self._view:
            await super().__call__(scope, receive, send)


def _wants_list(accept: str) -> bool:
    """Tell whether JSON is preferred over an event stream. Raises ProblemError when neither is accepted."""
    weights = {"text/event-stream": -1.0, "application/json": -1.0}
    specific = dict.fromkeys(weights, -1)
    for part in accept.split(","):
        media, *parameters = (piece.strip().lower() for piece in part.split(";"))
        weight = 1.0
        for parameter in parameters:
            name, _, value = parameter.partition("=")
            if name == "q":
                try:
                    weight = float(value)
                except ValueError:
                    weight = 0.0
        for known in weights:
            level = 2 if media == known else 1 if media == known.split("/")[0] + "/*" else 0 if media == "*/*" else -1
            if level > specific[known]:
                specific[known], weights[known] = level, weight
    best = max(weights.values())
    if best <= 0:
        raise ProblemError(
            "not-acceptable",
            f"the header Accept is {accept[:100]!r}",
            remedy="Accept text/event-stream or application/json",
        )
    # Clients that name JSON and also take anything (as HTTP libraries do) want JSON.
    json, stream = "application/json", "text/event-stream"
    return (weights[json], specific[json]) > (weights[stream], specific[stream])


async def _stream(state: EdgeState, mission_id: str, start: int, request: Request) -> AsyncIterator[ServerSentEvent]:
    """Yield the log after ``start``, first what is stored, then what happens, as long as the client may see it."""
    try:
        async with aclosing(_entries(state, mission_id, start, request)) as entries:
            async for entry in entries:
                yield entry
    except (SQLAlchemyError, sqlite3.Error) as error:
        trouble = trouble_of(error)
        if not trouble:
            raise
        # As when watching ends: the client reconnects with its Last-Event-ID and misses nothing.
        log.warning("a stream of events ended", mission=mission_id, why=trouble)


async def _entries(state: EdgeState, mission_id: str, start: int, request: Request) -> AsyncGenerator[ServerSentEvent]:
    mission = await state.service.get(mission_id)
    async with followed(mission) as (newest_id, messages):
        sent = start
        while sent < newest_id:
            async with state.replays:
                page = [(event.id, _sse(event)) for event in await events_after(mission, sent, PAGE)]
            if not page:
                break
            for event_id, text in page:
                yield text
                sent = event_id
        unwelcome = asyncio.create_task(until_unwelcome(request, state))
        try:
            async for message in _until_either(aiter(messages), state.stopping, unwelcome):
                # Two that were written at the same moment may come in either order.
                if isinstance(message, EventMessage) and message.event.id > sent:
                    yield _sse(message.event)
        except WatchEndedError:
            return  # the client reconnects with its Last-Event-ID and misses nothing
        finally:
            unwelcome.cancel()


def _sse(event: EventView) -> ServerSentEvent:
    return ServerSentEvent(event.model_dump_json(), id=str(event.id), event=event.kind, retry=RECONNECT_MS)


async def _until_either(
    messages: AsyncIterator[LiveMessage], stopping: asyncio.Event, unwelcome: asyncio.Task[None]
) -> AsyncIterator[LiveMessage]:
    """Yield messages until the process is asked to end, or the client may not see them any more."""
    newest: LiveMessage | None = None

    async def take() -> None:
        nonlocal newest
        newest = await anext(messages, None)

    while await first_of(take(), stopping.wait(), asyncio.wait([unwelcome])) == 0 and newest is not None:
        yield newest


@router.websocket("/live")
async def live(websocket: WebSocket, mission_id: str) -> None:
    """Send LiveMessage objects as JSON text: first a snapshot, then what changes.

    Closes with 4401 (no valid token in the Authorization header and no session), 4403, 4404 (no such mission),
    4429 (too many viewers), 1013 (fell behind, or the mission cannot be had at the moment: reconnect) or 1001 (the
    service ends).
    """
    state = edge_state(websocket)
    await websocket.accept()
    try:
        await authenticate(websocket, state)
        with state.stream("websocket", websocket):
            await _serve(websocket, state, mission_id)
    except ProblemError as error:
        codes = {
            "unauthenticated": close_codes.UNAUTHENTICATED,
            "forbidden": close_codes.FORBIDDEN,
            "too-many-streams": close_codes.TOO_MANY,
        }
        await _close(websocket, codes[error.kind], error.detail)
    except (MissionElsewhereError, NotAMemberError) as error:
        await _close(websocket, close_codes.TRY_AGAIN, str(error))
    except MissionError as error:
        await _close(websocket, close_codes.NOT_FOUND, str(error))
    except WatchEndedError as error:
        await _close(websocket, close_codes.TRY_AGAIN, f"{error}: reconnect")
    except (SQLAlchemyError, sqlite3.Error) as error:
        trouble = trouble_of(error)
        if not trouble:
            raise
        log.warning("a live view ended", mission=mission_id, why=trouble)
        await _close(websocket, close_codes.TRY_AGAIN, trouble)
    except WebSocketDisconnect:
        pass


async def _serve(websocket: WebSocket, state: EdgeState, mission_id: str) -> None:
    if not is_mission_id(mission_id):
        raise MissionNotFoundError(f"there is no mission {mission_id[:64]!r}", "GET /api/v1/missions lists all")
    async with watched(await state.service.get(mission_id)) as messages:
        ended = await first_of(
            _send_all(websocket, messages),
            _until_left(websocket),
            state.stopping.wait(),
            until_unwelcome(websocket, state),
        )
        if ended == 2:
            await _close(websocket, close_codes.GOING_AWAY, "the service ends")
        if ended == 3:
            await _close(websocket, close_codes.UNAUTHENTICATED, "the access token or the session has ended")


async def _send_all(websocket: WebSocket, messages: AsyncIterator[LiveMessage]) -> None:
    async for message in messages:
        await websocket.send_text(_text(message))


def _text(message: LiveMessage) -> str:
    """Return a message as JSON; one that goes to many viewers is written once."""
    if isinstance(message, SnapshotMessage):
        return _message.dump_json(message).decode()
    known = _texts.get(id(message))
    if known is None:
        # The message is kept beside its text, so that no other one gets its id.
        known = _texts[id(message)] = (message, _message.dump_json(message).decode())
        while len(_texts) > KEPT_TEXTS:
            _texts.popitem(last=False)
    return known[1]


async def _until_left(websocket: WebSocket) -> None:
    """Return when the client leaves; what it sends is not read."""
    while (await websocket.receive())["type"] != "websocket.disconnect":
        pass


async def _close(websocket: WebSocket, code: int, reason: str) -> None:
    try:
        # A close frame has room for 123 bytes of reason.
        await websocket.close(code, reason.encode()[:120].decode(errors="ignore"))
    except (RuntimeError, WebSocketDisconnect, anyio.ClosedResourceError):
        log.debug("viewer was gone before it could be told", reason=reason)
