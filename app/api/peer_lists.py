"""Lists of what all processes that share the database have."""

import asyncio
from typing import TypeVar

import httpx
import structlog
from pydantic import TypeAdapter
from starlette.requests import Request

from app.api.accounts.processes import comes_from_peer
from app.api.state import EdgeState
from app.missions.running.ownership import Peer

ANSWER_S = 5.0
"""How long another process may take to answer."""

T = TypeVar("T")

log = structlog.get_logger(__name__)


async def from_peers(request: Request, edge: EdgeState, kind: TypeAdapter[list[T]]) -> list[T]:
    """Return what the other processes answer to the same request for a list; one that does not answer is left out."""
    if comes_from_peer(request.scope):
        return []

    async def ask(peer: Peer) -> list[T]:
        try:
            asked = edge.peers.request(peer, request.scope, request.url.path, timeout=ANSWER_S)
            answer = await edge.peers.to(peer).send(asked)
            answer.raise_for_status()
        except httpx.HTTPError as error:
            log.warning("another process does not answer", url=peer.url, error=str(error) or type(error).__name__)
            return []
        return kind.validate_json(answer.content)

    lists = await asyncio.gather(*(ask(peer) for peer in edge.service.process.peers))
    return [item for found in lists for item in found]
