"""Whether the service is well, for orchestrators and monitoring."""

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST

from app import __version__
from app.api.access.auth import Reader
from app.api.http.problems import problems
from app.api.metrics import exposition
from app.api.schemas import ComponentHealth, Liveness
from app.api.state import EdgeState, Service, State


def health_router(prefix: str) -> APIRouter:
    """Return the routes of health and metrics under ``prefix``.

    They exist twice: in the API, and at the root where container platforms and Prometheus look for them.
    """
    router = APIRouter(prefix=prefix, tags=["health"])

    @router.get("/health", operation_id="getHealth", summary="See the service's health")
    async def health(state: State) -> ComponentHealth:
        """Return the state of every component; the status is 200 even when one fails."""
        return await _summary(state)

    @router.get("/health/live", operation_id="getLiveness", summary="Is the process alive")
    async def live() -> Liveness:
        """Answer as long as the process runs. On failure: restart it."""
        return Liveness()

    @router.get(
        "/health/ready",
        operation_id="getReadiness",
        summary="Can it do its work",
        responses={503: {"model": ComponentHealth, "description": "A component fails"}},
    )
    async def ready(state: State, response: Response) -> ComponentHealth:
        """Answer 200 when every component works, 503 otherwise. On failure: send no requests, do not restart."""
        summary = await _summary(state)
        if summary.status != "ok":
            response.status_code = 503
        return summary

    @router.get(
        "/metrics",
        operation_id="getMetrics",
        summary="Measurements for Prometheus",
        response_class=Response,
        responses=problems("unauthenticated", "forbidden")
        | {200: {"description": "Prometheus' text format", "content": {"text/plain": {"schema": {"type": "string"}}}}},
    )
    async def metrics(service: Service, reader: Reader) -> Response:
        """Return counts and times of requests, missions, soundings, steps, planning, vehicles and viewers."""
        content = exposition(await service.missions(), await service.vehicles())
        return Response(content, headers={"Content-Type": CONTENT_TYPE_LATEST})

    return router


async def _summary(state: EdgeState) -> ComponentHealth:
    ok, components = await state.service.ready()
    stopping = state.stopping.is_set()
    if stopping:
        components = components | {"process": "is shutting down"}
    return ComponentHealth(
        status="ok" if ok and not stopping else "failing",
        version=__version__,
        components=components,
        compiling=state.service.compiling,
    )
