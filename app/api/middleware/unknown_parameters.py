"""What a request carries that its route does not know: it is refused, for whoever sent it counts on it.

One that went unnoticed could have been meant to keep something from happening.
"""

from collections.abc import Collection, Iterator

from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute
from pydantic import BaseModel
from starlette.requests import Request

from app.api.access.auth import RoleCheck
from app.api.http.field_problems import MAX_ERRORS, invalid, plain, shortened, suggestion
from app.api.http.problems import FieldProblem, Problem
from app.api.schemas import API
from app.api.state import edge_state


class KnownParameters:
    """What a route of the REST interface takes in its query."""

    def __init__(self, route: APIRoute) -> None:
        parts = list(_parts(route.dependant))
        # The standards' own interfaces have rules of their own for parameters.
        self._of_rest = route.path.startswith(API)
        self._role = next((part.call for part in parts if isinstance(part.call, RoleCheck)), None)
        self._query = {name for part in parts for name in _query_names(part)}

    async def problem(self, request: Request) -> Problem | None:
        """Return what is wrong with a request's parameters; whoever may not ask is told only that.

        Raises ProblemError.
        """
        if not self._of_rest:
            return None
        unknown = [name for name in request.query_params if name not in self._query] if request.url.query else []
        if not unknown:
            return None
        if self._role is not None:
            await self._role.admit(request, edge_state(request))
        return self._unknown(request, unknown)

    def _unknown(self, request: Request, names: Collection[str]) -> Problem:
        errors = [
            FieldProblem(
                location="query",
                field=shortened(name),
                value=plain(request.query_params[name]),
                message="There is no such parameter here",
                expected=suggestion(name, self._query) or "no parameters in the query",
            )
            for name in list(names)[:MAX_ERRORS]
        ]
        return invalid(errors, len(names), request.scope)


def _parts(dependant: Dependant) -> Iterator[Dependant]:
    """Return an endpoint's own parameters and those of everything that it depends on."""
    yield dependant
    for part in dependant.dependencies:
        yield from _parts(part)


def _query_names(dependant: Dependant) -> Iterator[str]:
    for field in dependant.query_params:
        annotation = field.field_info.annotation
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield from (one.alias or name for name, one in annotation.model_fields.items())
        else:
            yield field.alias
