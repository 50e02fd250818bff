"""The words of reports: the same in every language, all used, numbers as the language writes them."""

import inspect
import re
import sys
from collections.abc import Iterable

import pytest

from app.estimation.uncertainty import COMPONENTS
from app.mapping.s44 import Order
from app.missions.report import charts, contents
from app.missions.report.texts import NONE, Language, Texts, catalogue, placeholders
from app.missions.spec.failsafes import Failsafe, Response
from app.missions.spec.mission import MissionKind
from app.missions.spec.vehicle import Sensor, VehicleKind
from app.missions.states import MissionState

GROUPS: dict[str, Iterable[str]] = {
    "order": Order,
    "purpose": MissionKind,
    "state": MissionState,
    "kind": VehicleKind,
    "sensor": Sensor,
    "failsafe": Failsafe,
    "response": Response,
    "error": COMPONENTS,
    "section": contents.SECTIONS,
}


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_a_text_is_there_in_every_language_with_the_same_placeholders(name: str) -> None:
    wordings = catalogue()[name]
    assert set(wordings) == set(Language)
    assert all(words.strip() == words != "" for words in wordings.values())
    assert len({frozenset(placeholders(words)) for words in wordings.values()}) == 1


@pytest.mark.parametrize("group", GROUPS)
def test_every_value_of_an_enumeration_has_a_word(group: str) -> None:
    assert {f"{group}_{value}" for value in GROUPS[group]} <= set(catalogue())


def test_every_text_that_is_asked_for_is_in_the_catalogue() -> None:
    modules = [charts, contents, *{sys.modules[make.__module__] for make in contents.SECTIONS.values()}]
    source = "".join(map(inspect.getsource, modules))
    named = set(re.findall(r'(?:\bt|\.t|texts)\(\s*"([a-z0-9_A-Z]+)"', source))
    assert len(named) > 80
    assert named <= set(catalogue())


@pytest.mark.parametrize(
    ("language", "value", "decimals", "unit", "signed", "shown"),
    [
        ("en", 1234567.891, 2, "m", False, "1\u202f234\u202f567.89\u00a0m"),
        ("pt", 1234567.891, 2, "m", False, "1\u202f234\u202f567,89\u00a0m"),
        ("en", -0.0004, 3, "", True, "0.000"),
        ("pt", 0.25, 2, "", True, "+0,25"),
        ("en", -8.5, 1, "°", False, "−8.5°"),
        ("pt", None, 1, "m", False, NONE),
    ],
)
def test_numbers_are_written_as_the_language_does(
    language: str, value: float | None, decimals: int, unit: str, signed: bool, shown: str
) -> None:
    assert Texts(Language(language)).number(value, decimals, unit, signed=signed) == shown


def test_times_are_utc_to_the_second_and_what_is_no_time_is_shown() -> None:
    t = Texts(Language.EN)
    assert t.moment(1_795_225_140.9) == "2026-11-21 01:39:00 UTC"
    assert t.moment("2026-11-21T03:39:00+02:00") == "2026-11-21 01:39:00 UTC"
    assert t.moment(None) == NONE
    assert t.moment(1e300) == "1e+300"
