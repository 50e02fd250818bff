"""The wall clock, in one place."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime

_unix_s: Callable[[], float] | None = None


def now() -> datetime:
    """Return the present time, aware, in UTC."""
    return datetime.now(UTC) if _unix_s is None else datetime.fromtimestamp(_unix_s(), UTC)


@contextmanager
def told_by(unix_s: Callable[[], float]) -> Iterator[None]:
    """Take the time from elsewhere, Unix seconds: where it is simulated."""
    global _unix_s
    before, _unix_s = _unix_s, unix_s
    try:
        yield
    finally:
        _unix_s = before
