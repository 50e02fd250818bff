"""The mission that a request is about."""

from typing import Annotated

from fastapi import Depends

from app.api.access.auth import Reader
from app.api.schemas import MissionId
from app.api.state import Service
from app.missions.live.mission import LiveMission


async def mission_of(mission_id: MissionId, reader: Reader, service: Service) -> LiveMission:
    """Return the mission; nobody is told whether there is one who may not even look. Raises MissionNotFoundError."""
    return await service.get(mission_id)


Mission = Annotated[LiveMission, Depends(mission_of)]
"""Comes after who asks in a route's parameters: dependencies are resolved in their order."""
