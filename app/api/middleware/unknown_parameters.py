"""What a request carries that its route does not know: it is refused, for whoever sent it counts on it.

An unknown query parameter that went unnoticed could have been meant to keep something from happening; an
`Idempotency-Key` that has no effect lets an order that is sent again happen twice.
"""

from collections.abc import Collection

from fastapi.routing import APIRoute
from starlette.requests import Request

from app.api.access.auth import RoleCheck
from app.api.http.field_problems import MAX_ERRORS, invalid, plain, shortened, suggestion
from app.api.http.problems import FieldProblem, Problem, ProblemError
from app.api.http.route_parameters import parts_of, query_names
from app.api.schemas import API
from app.api.state import edge_state

IDEMPOTENCY_KEY = "idempotency-key"


class KnownParameters:
    """What a route of the REST interface takes in its query, and whether it takes an `Idempotency-Key`."""

    def __init__(self, route: APIRoute) -> None:
        parts = list(parts_of(route.dependant))
        # The standards' own interfaces have rules of their own for parameters.
        self._of_rest = route.path.startswith(API)
        self._role = next((part.call for part in parts if isinstance(part.call, RoleCheck)), None)
        self._query = query_names(route.dependant)
        headers = {field.alias.lower() for part in parts for field in part.header_params}
        self._ignores_keys = "POST" in (route.methods or ()) and IDEMPOTENCY_KEY not in headers

    async def problem(self, request: Request) -> Problem | None:
        """Return what is wrong with a request's parameters; whoever may not ask is told only that.

        Raises ProblemError.
        """
        if not self._of_rest:
            return None
        sent = request.query_params if request.scope["query_string"] else ()
        unknown = [name for name in sent if name not in self._query]
        ignored = self._ignores_keys and IDEMPOTENCY_KEY in request.headers
        if not (unknown or ignored):
            return None
        if self._role is not None:
            await self._role.admit(request, edge_state(request))
        if unknown:
            return self._unknown(request, unknown)
        raise ProblemError(
            "invalid-parameter",
            "the header Idempotency-Key has no effect here: what is sent again would happen again",
            remedy="Leave it out, and see what happened before sending again; only POST …/measurements takes it",
        )

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
