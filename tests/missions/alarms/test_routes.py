"""Who is told of which alarm, and after how long."""

from hypothesis import given
from hypothesis import strategies as st

from app.missions.alarm_kinds import AlarmKind, AlarmSeverity
from app.missions.alarm_settings import AlarmSettings
from app.missions.alarms.routes import EscalationStep, delivery_id, due, steps
from app.missions.views.alarms import Notice

SECRET = "sixteen bytes or more"  # noqa: S105 - the test's own


def settings(*routes: dict[str, object]) -> AlarmSettings:
    hooks = [{"name": name, "url": "http://127.0.0.1/", "secret": SECRET} for name in "abc"]
    return AlarmSettings.model_validate({"webhooks": hooks, "routes": routes})


def told(found: AlarmSettings, kind: AlarmKind, severity: AlarmSeverity, name: str = "Harbour") -> list[EscalationStep]:
    return steps(found, kind, severity, "id-1", name)


def test_routes_choose_by_severity_kind_and_mission() -> None:
    found = settings(
        {"to": ["a"], "severity": "critical"},
        {"to": ["b"], "kinds": ["leak", "test"], "after_s": 60},
        {"to": ["c", "a"], "missions": ["Harb*"], "after_s": 5},
    )
    assert told(found, AlarmKind.LEAK, AlarmSeverity.CRITICAL) == [
        EscalationStep("a", 0),
        EscalationStep("c", 5),
        EscalationStep("b", 60),
    ]
    assert told(found, AlarmKind.VEHICLE_LOST, AlarmSeverity.MAJOR) == [EscalationStep("c", 5), EscalationStep("a", 5)]
    assert told(found, AlarmKind.VEHICLE_LOST, AlarmSeverity.MAJOR, "Bay") == []
    assert steps(found, AlarmKind.TEST, AlarmSeverity.MINOR, None, "") == [EscalationStep("b", 60)]
    assert steps(settings({"to": ["a"], "missions": ["id-?"]}), AlarmKind.LEAK, AlarmSeverity.MAJOR, "id-1", "") == [
        EscalationStep("a", 0)
    ]


@given(
    after=st.lists(st.sampled_from([0.0, 1.0, 60.0, 120.0, 600.0]), min_size=1, max_size=6),
    looks=st.lists(st.floats(0, 1000), min_size=1, max_size=12).map(sorted),
)
def test_everybody_is_told_once_in_time_however_often_is_looked(after: list[float], looks: list[float]) -> None:
    ladder = sorted((EscalationStep(str(k), s) for k, s in enumerate(after)), key=lambda step: step.after_s)
    told_s, found = None, []
    for age_s in looks:
        now, next_s = due(ladder, told_s, age_s)
        assert all(step.after_s <= age_s for step in now)
        assert next_s is None or next_s > age_s
        found += now
        told_s = age_s
    assert found == [step for step in ladder if step.after_s <= looks[-1]]


def test_the_id_of_a_delivery_follows_from_alarm_recipient_and_notice() -> None:
    ids = {delivery_id(a, r, n) for a in ("x", "y") for r in ("a", "b") for n in Notice}
    assert len(ids) == 2 * 2 * len(Notice)
    assert delivery_id("x", "a", Notice.RAISED) in ids
