"""Routes that take JSON: the body is bounded, read and checked before anything is made of it, long ones in a thread."""

import asyncio
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from json import JSONDecodeError
from typing import Any

from fastapi import Request
from fastapi.routing import APIRoute
from starlette.responses import Response
from starlette.types import Scope

from app.api.http.error_handlers import SENT
from app.api.http.field_problems import invalid, validation_problem
from app.api.http.json_text import (
    Bounds,
    EntryTooLongError,
    NameTwiceError,
    Unreadable,
    may_be_unstorable,
    parse,
    unstorable,
)
from app.api.http.problems import FieldProblem, Problem, instance_of, make_problem, problem_response

IN_THREAD_BYTES = 32_768
"""Longer bodies are read and checked in a thread."""

SHOWN_BYTES = 131_072
"""Longer bodies are not kept beside what is made of them, to show what was sent."""

# One after the other: what a body becomes takes many times its memory.
_reader = ThreadPoolExecutor(1, thread_name_prefix="bodies")


class JsonRoute(APIRoute):
    """Gives its endpoint a body that was checked already.

    What a model's attribute ``json_bounds`` says counts for its bodies in place of the usual :class:`Bounds`. One whose
    ``judges_items`` is true gets an :class:`Unreadable` for each of its ``items`` with text that cannot be stored.
    """

    @cached_property
    def check(self) -> Callable[[bytes, Scope], Coroutine[Any, Any, tuple[Any, Problem | None]]] | None:
        """What makes a body the endpoint's value, or says what is wrong with it; None: the route takes no body."""
        if self.body_field is None:
            return None
        field = self.body_field
        model = field.field_info.annotation
        bounds: Bounds = getattr(model, "json_bounds", Bounds())
        judges_items: bool = getattr(model, "judges_items", False)

        def checked(body: bytes, scope: Scope) -> tuple[Any, Problem | None]:
            if excess := bounds.excess(body):
                return None, _too_much(excess, scope)
            try:
                parsed = parse(body)
            except EntryTooLongError as error:
                return None, _too_much(str(error), scope)
            except (ValueError, RecursionError) as error:
                return None, _malformed(error, scope)
            if may_be_unstorable(body):
                for path, text in list(unstorable(parsed)):
                    if not (judges_items and _is_of_item(parsed, path)):
                        return None, invalid([_unstorable(path, text)], 1, scope)
                    fault = _unstorable(path[2:], text)
                    words = f"{fault.field}: {fault.message}; expected {fault.expected}"
                    parsed["items"][int(path[1])] = Unreadable(words)
            if parsed is None:
                return None, None
            if len(body) <= SHOWN_BYTES:
                scope.setdefault("state", {})[SENT] = parsed
            value, errors = field.validate(parsed, {}, loc=("body",))
            return value, validation_problem(errors, model, scope) if errors else None

        async def check(body: bytes, scope: Scope) -> tuple[Any, Problem | None]:
            if len(body) <= IN_THREAD_BYTES:
                return checked(body, scope)
            return await asyncio.get_running_loop().run_in_executor(_reader, checked, body, scope)

        return check

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return what answers a request."""
        handle = super().get_route_handler()
        if self.check is None:
            return handle
        check = self.check

        async def read_first(request: Request) -> Response:
            body = await request.body()
            if not body:
                return await handle(request)
            value, problem = await check(body, request.scope)
            if problem is not None:
                return problem_response(problem)
            return await handle(_Checked(request, value))

        return read_first


class _Checked(Request):
    """A request whose body was read: FastAPI finds the model in place of the JSON, and has nothing more to do."""

    def __init__(self, request: Request, model: Any) -> None:
        super().__init__(request.scope, request.receive, request._send)
        self._body = b"checked"
        self._json = model


def _malformed(error: Exception, scope: Scope) -> Problem:
    if isinstance(error, JSONDecodeError):
        detail = f"the body is not JSON: {error.msg} at character {error.pos}"
    elif isinstance(error, RecursionError):
        detail = "the body is nested too deep"
    elif isinstance(error, UnicodeDecodeError):
        detail = f"the body is not JSON in UTF-8: {error.reason} at byte {error.start}"
    elif isinstance(error, NameTwiceError):
        detail = f"the body names {error.args[0][:80]!r} twice in one object"
    else:
        detail = "the body has a number of too many digits"
    return make_problem(
        "malformed-body", detail, instance=instance_of(scope), remedy="Send the body as valid JSON (RFC 8259)"
    )


def _too_much(excess: str, scope: Scope) -> Problem:
    return make_problem(
        "body-too-large",
        f"the body has too much in it: {excess}",
        instance=instance_of(scope),
        remedy="Send it in several requests, or simplify it",
    )


def _is_of_item(parsed: Any, path: tuple[str, ...]) -> bool:
    """Tell whether a path leads into one of a body's items: a list's entry can be refused by itself."""
    return len(path) > 1 and path[0] == "items" and isinstance(parsed["items"], list)


def _unstorable(path: tuple[str, ...], text: str) -> FieldProblem:
    return FieldProblem(
        location="body",
        field=".".join(name[:100] for name in path)[:200].encode("ascii", "backslashreplace").decode() or "body",
        value=ascii(text[:100])[:100],
        message="the text holds a NUL character or a lone surrogate",
        expected="valid Unicode text",
    )
