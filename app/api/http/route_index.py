"""Which route answers a path: looked up by the path's parts, not by asking one route after the other."""

from collections.abc import Iterable
from typing import Generic, TypeVar

from fastapi.routing import APIRoute

T = TypeVar("T")

_Shape = tuple[int, ...]
"""Where among a path's parts its fixed words are."""


class RouteIndex(Generic[T]):
    """Finds what belongs to a request's route, the first one that was registered where several match.

    Parameters
    ----------
    entries
        Routes in the order in which they are asked, and what belongs to each.
    """

    def __init__(self, entries: Iterable[tuple[APIRoute, T]]) -> None:
        self._shapes: dict[tuple[str, int], dict[_Shape, dict[tuple[str, ...], list[int]]]] = {}
        self._others: dict[str, list[int]] = {}
        self._entries = list(entries)
        for number, (route, _) in enumerate(self._entries):
            for method in route.methods or ():
                self._add(number, route, method)

    def _add(self, number: int, route: APIRoute, method: str) -> None:
        parts = route.path_format.split("/")
        fixed = tuple(place for place, part in enumerate(parts) if "{" not in part)
        whole = all(part == f"{{{part[1:-1]}}}" for place, part in enumerate(parts) if place not in fixed)
        # A convertor may take slashes, and so any number of parts.
        if not whole or any(f"{{{name}:" in route.path for name in route.param_convertors):
            self._others.setdefault(method, []).append(number)
            return
        words = tuple(parts[place] for place in fixed)
        of_length = self._shapes.setdefault((method, len(parts)), {})
        of_length.setdefault(fixed, {}).setdefault(words, []).append(number)

    def of(self, method: str) -> list[T]:
        """Return what belongs to the routes of a method, in their order."""
        return [belonging for route, belonging in self._entries if method in (route.methods or ())]

    def find(self, method: str, path: str) -> tuple[APIRoute, dict[str, str], T] | None:
        """Return the route that answers, its parameters as texts, and what belongs to it; None: there is none."""
        parts = path.split("/")
        numbers = list(self._others.get(method, ()))
        for fixed, known in self._shapes.get((method, len(parts)), {}).items():
            numbers += known.get(tuple([parts[place] for place in fixed]), ())
        for number in sorted(numbers):
            route, belonging = self._entries[number]
            found = route.path_regex.match(path)
            if found:
                return route, found.groupdict(), belonging
        return None
