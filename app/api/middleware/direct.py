"""Requests answered without detours: what an endpoint needs is worked out when the service starts.

The framework finds out with every request which route is meant, what its endpoint needs and in what order, and opens
two stacks for what may have to be closed: several times the work of most answers. Here that is done once per route.
Only what is in order is answered here. Whatever cannot be read goes the framework's way, which says what is wrong.
"""

import inspect
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from fastapi import APIRouter
from fastapi.datastructures import DefaultPlaceholder
from fastapi.dependencies.models import Dependant
from fastapi.dependencies.utils import request_params_to_args
from fastapi.routing import APIRoute
from pydantic import TypeAdapter
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.access.auth import RoleCheck
from app.api.bodies.admission import replayed
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import problem_response
from app.api.http.route_index import RouteIndex
from app.api.middleware.unknown_parameters import KnownParameters
from app.api.state import AT_HAND


class _NotInOrderError(Exception):
    """The framework shall say what is wrong."""


@dataclass(frozen=True, slots=True)
class _Step:
    """One thing that an endpoint needs, or the endpoint itself.

    ``given`` are the numbers of steps before it, by the name of the parameter that takes what they return.
    """

    call: Callable[..., Any]
    at_hand: bool
    role: RoleCheck | None
    given: tuple[tuple[str, int], ...]
    read: Dependant | None
    """Where its own parameters are read from path, query and headers."""
    requests: tuple[str, ...]
    """Parameters that take the request itself."""
    response: str | None
    body: str | None


class _Plan:
    """A route's endpoint and what comes before it, in the framework's order. Raises ValueError where it needs more."""

    def __init__(self, route: APIRoute) -> None:
        if type(route) not in (APIRoute, JsonRoute):
            raise ValueError("the route has ways of its own")
        if not isinstance(route.response_class, DefaultPlaceholder) and route.response_model is not None:
            raise ValueError("the route makes answers of a class of its own")
        if any(getattr(route, name, None) for name in _WAYS_OF_ITS_OWN) or not route.response_model_by_alias:
            raise ValueError("the route's answers are made in a way of its own")
        self.steps: list[_Step] = []
        self._numbers: dict[Any, int] = {}
        self.check = route.check if isinstance(route, JsonRoute) else None
        if route.body_field is not None and (self.check is None or len(route.dependant.body_params) != 1):
            raise ValueError("the route's body is not one JSON value")
        self._add(route.dependant, route)
        self.status = route.status_code or 200
        self.model: type | None = route.response_model if isinstance(route.response_model, type) else None
        self.adapter = TypeAdapter(route.response_model) if route.response_model is not None else None

    def _add(self, dependant: Dependant, route: APIRoute) -> int:
        call = dependant.call
        if call in self._numbers:
            return self._numbers[call]
        if call is None or not _is_coroutine(call):
            raise ValueError("it is called in a way of its own")
        if dependant.cookie_params or dependant.background_tasks_param_name or dependant.security_scopes_param_name:
            raise ValueError("it takes what is not read here")
        top = dependant is route.dependant
        if dependant.body_params and not top:
            raise ValueError("a dependency takes the body")
        role = call if isinstance(call, RoleCheck) else None
        given = [] if role else [(d.name, self._add(d, route)) for d in dependant.dependencies]
        names = (dependant.request_param_name, dependant.http_connection_param_name)
        reads = dependant.path_params or dependant.query_params or dependant.header_params
        step = _Step(
            call=call,
            at_hand=call in AT_HAND,
            role=role,
            given=tuple((name, number) for name, number in given if name is not None),
            read=dependant if reads else None,
            requests=tuple(name for name in names if name is not None),
            response=dependant.response_param_name,
            body=dependant.body_params[0].name if dependant.body_params else None,
        )
        self.steps.append(step)
        self._numbers[call] = len(self.steps) - 1
        return len(self.steps) - 1

    async def answer(self, request: Request, content: Any) -> Response:
        """Return what the endpoint answers. Raises what it raises, and _NotInOrderError."""
        state = request.scope["app"].state.edge
        response: Response | None = None
        found: list[Any] = []
        for step in self.steps:
            if step.at_hand:
                found.append(AT_HAND[step.call](state))
                continue
            if step.role is not None:
                found.append(await step.role.admit(request, state))
                continue
            values = {name: found[number] for name, number in step.given}
            if step.read is not None:
                _read(step.read, request, values)
            for name in step.requests:
                values[name] = request
            if step.response is not None:
                if response is None:
                    response = _empty()
                values[step.response] = response
            if step.body is not None:
                values[step.body] = content
            found.append(await step.call(**values))
        return self._response(found[-1], response)

    def _response(self, answer: Any, changes: Response | None) -> Response:
        if isinstance(answer, Response):
            return answer
        status = changes.status_code if changes is not None and changes.status_code else self.status
        if self.adapter is None or status == 204:
            made = Response(b"" if status == 204 else b"null", status, media_type=None if status == 204 else _JSON)
        else:
            if type(answer) is not self.model:
                answer = self.adapter.validate_python(answer, from_attributes=True)
            made = Response(self.adapter.dump_json(answer, by_alias=True), status, media_type=_JSON)
        if changes is not None:
            made.raw_headers.extend(changes.raw_headers)
        return made


_JSON = "application/json"


_WAYS_OF_ITS_OWN = (
    *("is_json_stream", "is_sse_stream", "max_body_size", "response_model_include", "response_model_exclude"),
    *("response_model_exclude_unset", "response_model_exclude_defaults", "response_model_exclude_none"),
)
"""What a route may ask of the framework that is not done here; older frameworks do not know all of it."""


def _is_coroutine(call: Callable[..., Any]) -> bool:
    return inspect.iscoroutinefunction(call) or inspect.iscoroutinefunction(getattr(call, "__call__", None))  # noqa: B004


def _empty() -> Response:
    response = Response()
    del response.headers["content-length"]
    response.status_code = None  # type: ignore[assignment]
    return response


def _read(dependant: Dependant, request: Request, values: dict[str, Any]) -> None:
    """Add the parameters in path, query and headers. Raises _NotInOrderError where one cannot be read."""
    for fields, place in (
        (dependant.path_params, "path_params"),
        (dependant.query_params, "query_params"),
        (dependant.header_params, "headers"),
    ):
        if fields:
            found, errors = request_params_to_args(fields, getattr(request, place))
            if errors:
                raise _NotInOrderError
            values.update(found)


class DirectRoutes:
    """The innermost middleware: answers requests of the routers' routes, and leaves the rest to the framework.

    Requests with parameters that their route does not know are refused here, whoever would answer them.
    """

    def __init__(self, app: ASGIApp, routers: Iterable[APIRouter]) -> None:
        self.app = app
        self._index = RouteIndex(
            (route, (plan_of(route), KnownParameters(route)))
            for router in routers
            for route in router.routes
            if isinstance(route, APIRoute)
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or socket."""
        found = None
        if scope["type"] == "http" and not scope.get("root_path"):
            found = self._index.find(scope["method"], scope["path"])
        if found is None:
            await self.app(scope, receive, send)
            return
        route, parameters, (plan, known) = found
        request = Request(scope, receive, send)
        refusal = await _refusal(known, request)
        if refusal is not None:
            scope["route"] = route
            await refusal(scope, receive, send)
            return
        if plan is None or scope["app"].dependency_overrides:
            await self.app(scope, receive, send)
            return
        body = None
        scope.update(route=route, endpoint=route.endpoint, path_params=parameters)
        try:
            content = None
            if plan.check is not None:
                body = await request.body()
                content, problem = await plan.check(body, scope) if body else (None, None)
                if problem is not None:
                    await problem_response(problem)(scope, receive, send)
                    return
                if content is None:
                    raise _NotInOrderError
            response = await plan.answer(request, content)
        except _NotInOrderError:
            await self.app(scope, receive if body is None else replayed(body, receive), send)
            return
        except Exception as error:
            response = _explained(error, request)
        await _send(response, request, receive, send)


async def _refusal(known: KnownParameters, request: Request) -> Response | None:
    """Return the answer to a request with parameters that its route does not know; None where there are none."""
    try:
        problem = await known.problem(request)
    except Exception as error:
        return _explained(error, request)
    return None if problem is None else problem_response(problem)


async def _send(response: Response, request: Request, receive: Receive, send: Send) -> None:
    """Answer; what a response finds wrong before its first byte is an answer of its own."""
    began = False

    async def send_on(message: Message) -> None:
        nonlocal began
        began = True
        await send(message)

    try:
        await response(request.scope, receive, send_on)
    except Exception as error:
        if began:
            raise
        await _explained(error, request)(request.scope, receive, send)


def plan_of(route: APIRoute) -> _Plan | None:
    """Return how a route is answered; None: in the framework's way."""
    try:
        return _Plan(route)
    except ValueError:
        return None


def _explained(error: Exception, request: Request) -> Response:
    """Return the answer to an error as the framework would; raises it where it has none."""
    handlers = request.scope["app"].exception_handlers
    handler = next((handlers[kind] for kind in type(error).__mro__ if kind in handlers), None)
    if handler is None:
        raise error
    answer: Response = handler(request, error)
    return answer
