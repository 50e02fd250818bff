"""Speak to a bathyfleet service: :class:`Client` where a program waits, :class:`AsyncClient` with asyncio.

Every operation of the REST interface is a method, named after it (``createMission`` is ``create_mission``) and typed;
``models`` has the classes of what is sent and answered. Missions can also be given as dicts, as in the REST guide.
Importing this imports nothing of the service.
"""

from bathyfleet.client import models
from bathyfleet.client.async_client import AsyncClient
from bathyfleet.client.client import Client
from bathyfleet.client.problems import (
    BusyError,
    ConflictError,
    EndedError,
    InvalidRequestError,
    NotAllowedError,
    NotFoundError,
    ProblemError,
    ServiceError,
    UnreachableError,
)

__all__ = [
    "Client",
    "AsyncClient",
    "models",
    "ServiceError",
    "UnreachableError",
    "EndedError",
    "ProblemError",
    "NotAllowedError",
    "NotFoundError",
    "ConflictError",
    "InvalidRequestError",
    "BusyError",
]
