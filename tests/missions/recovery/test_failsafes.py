"""The table of failsafes, held against a slow account of what it promises, for all pairs of events."""

from itertools import permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.missions.recovery.failsafes import STRENGTH, TABLE, FailsafeJudge, table_text
from app.missions.spec.failsafes import Failsafe, Response
from tests.support.paths import PROJECT

ORDER = list(TABLE)


def test_every_failsafe_has_a_line_and_every_line_its_words() -> None:
    assert set(TABLE) == set(Failsafe)
    text = table_text()
    for failsafe, rule in TABLE.items():
        assert f"| `{failsafe}` | {rule.detected} |" in text
        assert rule.detected
        assert rule.shown


@pytest.mark.parametrize(("first", "second"), list(permutations(Failsafe, 2)))
def test_of_two_events_the_stronger_response_is_told_first(first: Failsafe, second: Failsafe) -> None:
    judge = FailsafeJudge()
    judge.judge({first: "one"}, 0.0)
    judge.judge({first: "one", second: "two"}, 1.0)
    found = judge.judge({first: "one", second: "two"}, 1000.0)
    assert {one.failsafe for one in found} == {first, second}
    expected = min((first, second), key=lambda f: (-STRENGTH[TABLE[f].response], ORDER.index(f)))
    assert found[0].failsafe is expected
    gone = judge.judge({second: "two"}, 1001.0)
    over_at_once = TABLE[first].over_s <= 1.0
    assert (first in {one.failsafe for one in gone}) is not over_at_once
    assert [one.failsafe for one in judge.judge({second: "two"}, 2000.0)] == [second]
    assert judge.judge({}, 3000.0) == []


def account(history: list[tuple[float, set[Failsafe], set[Failsafe]]]) -> set[Failsafe]:
    """Return what is in force after a history, from its beginning each time."""
    active: set[Failsafe] = set()
    for failsafe in Failsafe:
        rule = TABLE[failsafe]
        since: float | None = None
        seen = 0.0
        on = False
        for time_s, detected, unknown in history:
            if failsafe in detected:
                since = time_s if since is None else since
                seen = time_s
                on = on or time_s - since >= rule.after_s
            elif failsafe in unknown:
                seen = time_s
            elif since is not None and (not on or time_s - seen >= rule.over_s):
                since, on = None, False
        if on:
            active.add(failsafe)
    return active


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(
            st.floats(0.5, 200.0),
            st.sets(st.sampled_from(list(Failsafe)), max_size=4),
            st.sets(st.sampled_from(list(Failsafe)), max_size=4),
        ),
        min_size=1,
        max_size=25,
    )
)
def test_what_is_in_force_follows_the_table(moves: list[tuple[float, set[Failsafe], set[Failsafe]]]) -> None:
    judge, now_s = FailsafeJudge(), 0.0
    history: list[tuple[float, set[Failsafe], set[Failsafe]]] = []
    for passed_s, detected, unknown in moves:
        now_s += passed_s
        history.append((now_s, detected, unknown))
        found = judge.judge(dict.fromkeys(detected, "words"), now_s, unknown)
        assert {one.failsafe for one in found} == account(history)
        strengths = [STRENGTH[one.response] for one in found]
        assert strengths == sorted(strengths, reverse=True)


def test_a_mission_has_its_own_responses() -> None:
    judge = FailsafeJudge({Failsafe.GEOFENCE_LEFT: Response.RETURN})
    judge.judge({Failsafe.GEOFENCE_LEFT: "out"}, 0.0)
    [found] = judge.judge({Failsafe.GEOFENCE_LEFT: "out"}, 60.0)
    assert (found.response, found.message) == (Response.RETURN, "out")


def test_the_documentation_has_the_table() -> None:
    assert table_text() in (PROJECT / "docs" / "recovery.md").read_text(encoding="utf-8")
