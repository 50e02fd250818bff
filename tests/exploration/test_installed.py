"""Planners of other packages, as their entry points say."""

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import ClassVar

import pytest

from app.exploration.installed import GROUP, find_planners
from app.exploration.planner.base import PlannerBase
from app.exploration.planner.random_walk import RandomPlanner


class Wandering(RandomPlanner):
    """Wanders."""

    name: ClassVar[str] = "wandering"


class Unfinished(PlannerBase):
    name: ClassVar[str] = "unfinished"


HERE = "tests.exploration.test_installed"


def entry(name: str, value: str) -> EntryPoint:
    return EntryPoint(name, value if ":" in value or "." in value else f"{HERE}:{value}", GROUP)


def test_a_planner_that_can_be_used_is_taken_by_its_name() -> None:
    installed = find_planners({"cao"}, [entry("wandering", "Wandering")])
    assert installed.planners == {"wandering": Wandering}
    assert not installed.broken


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("cao", "Wandering", "bathyfleet has a planner 'cao' of its own: give it another name"),
        ("Wandering!", "Wandering", "'Wandering!' is no name for a planner: small letters, digits and hyphens"),
        ("roving", "Wandering", "its attribute name is 'wandering', its entry point is 'roving'"),
        ("unfinished", "Unfinished", "does not define _decide"),
        ("text", "HERE", "is no class derived from app.exploration.planner.base.PlannerBase"),
        ("gone", "Gone", "AttributeError: "),
        ("nowhere", "no.such.module:Planner", "ModuleNotFoundError: No module named 'no'"),
    ],
)
def test_what_is_no_planner_is_named_with_the_reason_and_spoils_no_other(name: str, value: str, reason: str) -> None:
    installed = find_planners({"cao"}, [entry(name, value), entry("wandering", "Wandering")])
    assert set(installed.planners) == {"wandering"}
    assert list(installed.broken) == [name]
    assert reason in installed.broken[name].reason


def test_a_module_that_ends_the_program_when_it_is_imported_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "leaving_planner.py").write_text("raise SystemExit('no licence')")
    monkeypatch.syspath_prepend(tmp_path)
    installed = find_planners((), [entry("leaving", "leaving_planner:Planner")])
    assert installed.broken["leaving"].reason == "SystemExit: no licence"


def test_of_two_with_one_name_one_is_taken() -> None:
    installed = find_planners((), [entry("wandering", "Wandering"), entry("wandering", "Unfinished")])
    assert installed.planners == {"wandering": Wandering}
    assert "brings a planner of that name, too" in installed.broken["wandering"].reason
