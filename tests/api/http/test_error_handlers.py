"""Whatever the mission service refuses with is answered as a problem of a kind."""

from collections.abc import Iterator

import app.main
from app.api.http.error_handlers import KINDS
from app.api.http.problems import TITLES
from app.missions.errors import MissionError


def below(cls: type[MissionError]) -> Iterator[type[MissionError]]:
    for sub in cls.__subclasses__():
        yield sub
        yield from below(sub)


def test_every_error_of_the_mission_service_has_a_kind() -> None:
    assert app.main, "all of the service is loaded, and with it its errors"
    errors = {cls for cls in below(MissionError) if cls.__module__.startswith("app.")}
    without = sorted(cls.__name__ for cls in errors - set(KINDS))
    assert not without, f"KINDS in app/api/http/error_handlers.py has no kind of problem for {', '.join(without)}"
    unknown = sorted(set(KINDS.values()) - set(TITLES))
    assert not unknown, f"TITLES in app/api/http/problems.py lacks {', '.join(unknown)}"
