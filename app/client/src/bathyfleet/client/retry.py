"""How long a request is repeated, and how soon. Knows no sleeping: the clients do that, each in its way."""

from __future__ import annotations

import ssl
import time
from collections.abc import Callable
from http import HTTPStatus

import httpx

from bathyfleet.client.problems import UnreachableError, problem_of

FIRST_S, LONGEST_S = 0.2, 5.0
LEAST_S = 2.0
"""An answer is waited for so long also at the very end of a given time."""
WORTH_REPEATING = (
    HTTPStatus.TOO_MANY_REQUESTS,
    HTTPStatus.BAD_GATEWAY,
    HTTPStatus.SERVICE_UNAVAILABLE,
    HTTPStatus.GATEWAY_TIMEOUT,
)
NEVER_SENT = (httpx.ConnectError, httpx.ConnectTimeout, httpx.PoolTimeout)
NEVER_DONE = frozenset(
    {
        "too-many-requests",
        "too-many-bytes",
        "too-many-connections",
        "overloaded",
        "import-unavailable",
        "not-ready",
    }
)
"""Kinds of problems with which the service says that nothing of a request was done: it may be sent again."""


class Attempts:
    """The attempts at one thing: each wait is twice the last one, until patience is at its end.

    Parameters
    ----------
    what : str
        What is attempted, for messages.
    patience_s : float
        Since the first failure, or the first one after :meth:`reached`.
    repeatable : bool
        Whether it may be done twice. What may not is only repeated where it cannot have arrived or was refused whole.
    within_s : float, optional
        For how long at all, from now on; then TimeoutError is raised.
    now : callable
        A clock in seconds.
    """

    def __init__(
        self,
        what: str,
        patience_s: float,
        *,
        repeatable: bool,
        within_s: float | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._what = what
        self._patience_s = patience_s
        self._repeatable = repeatable
        self._now = now
        self._until = None if within_s is None else now() + within_s
        self.reached()

    @property
    def left_s(self) -> float | None:
        """How long the answer to the next attempt may take; None: as long as to any request."""
        return None if self._until is None else max(self._until - self._now(), LEAST_S)

    def reached(self) -> None:
        """Begin anew: the service answers."""
        self._since: float | None = None
        self._next_s = FIRST_S

    def after_error(self, error: Exception) -> float:
        """Return seconds to wait before it is tried again.

        Raises UnreachableError when it is not, ValueError where no request can be made of what was given.
        """
        if isinstance(error, httpx.LocalProtocolError):
            raise ValueError(f"{self._what}: it cannot be sent: {error}") from error
        refused = certificate_refusal(error)
        if refused is not None:
            raise UnreachableError(
                f"{self._what}: its certificate is not trusted: {refused.verify_message}; verify= says what is"
            ) from error
        if not self._repeatable and not isinstance(error, NEVER_SENT):
            raise UnreachableError(
                f"{self._what}: no answer came ({_told(error)}); whether it was done has to be looked up"
            ) from error
        wait_s = self._wait()
        if wait_s is None:
            raise UnreachableError(
                f"{self._what}: nobody answered in {self._patience_s:g} s ({_told(error)})"
            ) from error
        return wait_s

    def after_answer(self, answer: httpx.Response) -> float | None:
        """Return seconds to wait before it is tried again; None: this answer is the one."""
        if answer.status_code not in WORTH_REPEATING:
            return None
        if not self._repeatable and problem_of(answer).kind not in NEVER_DONE:
            return None
        return self._wait(_retry_after_s(answer))

    def after_refusal(self, answer: httpx.Response) -> float:
        """Return seconds to wait before it is tried again. Raises the answer's ProblemError when it is not."""
        wait_s = self.after_answer(answer)
        if wait_s is None:
            raise problem_of(answer)
        return wait_s

    def after_end(self) -> float:
        """Return seconds to wait before a stream that was ended is opened again."""
        return self.after_error(ConnectionError("the stream was ended"))

    def _wait(self, least_s: float = 0.0) -> float | None:
        now = self._now()
        self._since = now if self._since is None else self._since
        wait_s = max(self._next_s, least_s)
        self._next_s = min(2.0 * self._next_s, LONGEST_S)
        if self._until is not None and now + wait_s > self._until:
            raise TimeoutError(f"{self._what}: no answer came in the time that was given")
        return wait_s if now + wait_s <= self._since + self._patience_s else None


def _retry_after_s(answer: httpx.Response) -> float:
    try:
        return max(float(answer.headers.get("retry-after", "")), 0.0)
    except ValueError:
        return 0.0


def certificate_refusal(error: BaseException | None) -> ssl.SSLCertVerificationError | None:
    """Return why a certificate was refused, where that is what is behind an error: asking again changes nothing."""
    while error is not None and not isinstance(error, ssl.SSLCertVerificationError):
        error = error.__cause__ or error.__context__
    return error


def _told(error: Exception) -> str:
    return str(error) or type(error).__name__
