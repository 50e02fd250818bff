"""What the client raises: problem documents of the service as exceptions, and the silence of a service."""

from __future__ import annotations

from http import HTTPStatus

import httpx
from pydantic import ValidationError

from bathyfleet.client.models import FieldProblem, Problem

MEDIA_TYPE = "application/problem+json"
SHOWN = 500


class ServiceError(Exception):
    """Anything that keeps the client from an answer."""


class UnreachableError(ServiceError):
    """Nobody answered, for as long as the client's patience lasts."""


class EndedError(ServiceError):
    """A mission has ended in another state than the one that was waited for."""


class ProblemError(ServiceError):
    """The service said why it does not do what it was asked.

    Parameters
    ----------
    problem : Problem
        Its document (RFC 9457).
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.problem = problem

    def __str__(self) -> str:
        """Return what happened, each wrong field with what would be right, and the remedy."""
        lines = [f"{self.problem.title}: {self.problem.detail}" if self.problem.detail else self.problem.title]
        lines += [f"  {e.field or e.location}: {e.message} (sent: {e.value!r}; {e.expected})" for e in self.errors]
        return "\n".join([*lines, *([self.problem.remedy] if self.problem.remedy else [])])

    @property
    def status(self) -> int:
        """The HTTP status."""
        return self.problem.status

    @property
    def kind(self) -> str:
        """The kind of problem as one word that does not change, for example ``map-not-ready``."""
        return self.problem.type.rpartition(":")[2]

    @property
    def errors(self) -> list[FieldProblem]:
        """The fields that are wrong, if any are: where, what was sent, what would be right."""
        return self.problem.errors


class NotAllowedError(ProblemError):
    """No valid token, or one that may not do this (401, 403)."""


class NotFoundError(ProblemError):
    """There is no such mission, vehicle, map or file (404)."""


class ConflictError(ProblemError):
    """It contradicts the present state (409)."""


class InvalidRequestError(ProblemError):
    """Values that cannot be taken (400, 413, 415, 422)."""


class BusyError(ProblemError):
    """Too much is asked for or under way, now (429, 503)."""


KINDS: dict[int, type[ProblemError]] = {
    HTTPStatus.BAD_REQUEST: InvalidRequestError,
    HTTPStatus.UNAUTHORIZED: NotAllowedError,
    HTTPStatus.FORBIDDEN: NotAllowedError,
    HTTPStatus.NOT_FOUND: NotFoundError,
    HTTPStatus.CONFLICT: ConflictError,
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE: InvalidRequestError,
    HTTPStatus.UNSUPPORTED_MEDIA_TYPE: InvalidRequestError,
    HTTPStatus.UNPROCESSABLE_ENTITY: InvalidRequestError,
    HTTPStatus.TOO_MANY_REQUESTS: BusyError,
    HTTPStatus.SERVICE_UNAVAILABLE: BusyError,
}


def problem_of(answer: httpx.Response) -> ProblemError:
    """Return the exception for an answer that is an error, also for one that is not the service's own (a proxy's)."""
    if answer.headers.get("content-type", "").startswith(MEDIA_TYPE):
        try:
            return raised(Problem.model_validate_json(answer.content))
        except ValidationError:
            pass
    return raised(made_up(answer.status_code, answer.text[:SHOWN], str(answer.request.url)))


def made_up(status: int, detail: str, instance: str, kind: str = "") -> Problem:
    """Return a problem for what has no document of its own."""
    try:
        title = HTTPStatus(status).phrase
    except ValueError:
        title = f"Status {status}"
    type_ = f"urn:bathyfleet:problem:{kind}" if kind else "about:blank"
    return Problem(type=type_, title=title, status=status, detail=detail, instance=instance, remedy="", errors=[])


def raised(problem: Problem) -> ProblemError:
    """Return a problem as the exception for its status."""
    return KINDS.get(problem.status, ProblemError)(problem)
