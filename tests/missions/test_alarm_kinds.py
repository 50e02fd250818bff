"""Every alarm is declared once, in the table, and raised somewhere."""

import re

from app.missions.alarm_kinds import ALARMS, AlarmKind, AlarmSeverity, alarms_text
from app.missions.recovery.failsafes import TABLE
from app.missions.spec.failsafes import Failsafe
from tests.support.paths import PROJECT

SOURCES = {path: path.read_text() for path in sorted((PROJECT / "app").rglob("*.py")) if path.name != "alarm_kinds.py"}


def test_every_kind_has_one_line_in_the_table() -> None:
    assert list(ALARMS) == list(AlarmKind)
    assert alarms_text().count("\n") == len(AlarmKind) + 2
    assert all(rule.raised and rule.action and rule.event for rule in ALARMS.values())


def test_every_failsafe_that_alarms_is_an_alarm_of_the_same_name() -> None:
    alarming = {failsafe.value for failsafe, rule in TABLE.items() if rule.shown.startswith("alarm")}
    assert alarming == {kind.value for kind in AlarmKind if kind.value in set(Failsafe)}
    assert all(ALARMS[AlarmKind(name)].event == "failsafe" for name in alarming)


def test_every_other_kind_is_raised_somewhere() -> None:
    text = "\n".join(SOURCES.values())
    named = {kind for kind in AlarmKind if re.search(rf"AlarmKind\.{kind.name}\b", text)}
    assert named == {kind for kind in AlarmKind if kind.value not in set(Failsafe)}


def test_no_line_of_level_alarm_is_written_past_the_table() -> None:
    made = [str(path.relative_to(PROJECT)) for path, text in SOURCES.items() if "Level.ALARM" in text]
    assert made == ["app/missions/live/journals/journal.py", "app/missions/operations/reports.py"]
    [journal] = [text for path, text in SOURCES.items() if path.name == "journal.py" and path.parent.name == "journals"]
    assert journal.count("Level.ALARM") == 1


def test_severities_are_ordered() -> None:
    minor, major, critical = AlarmSeverity
    assert critical.at_least(minor)
    assert major.at_least(major)
    assert not minor.at_least(major)
