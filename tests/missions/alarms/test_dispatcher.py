"""Alarms leave the service: told once, again when that failed, to the next ones when nobody acknowledges."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta

import pytest
from standardwebhooks import Webhook

from app.missions.alarm_kinds import AlarmKind, AlarmSeverity
from app.missions.alarm_settings import AlarmSettings
from app.missions.alarms import channels
from app.missions.alarms.raised import copy_of, make_alarm
from app.missions.errors import AlarmNotFoundError, InvalidRequestError
from app.missions.views.alarms import AlarmState, DeliveryState
from tests.support.missions.alarms import BEGAN, SECRET, Clock, Watch, end_of_process, hook, told_by
from tests.support.waiting import until

Keep = Callable[[AlarmSettings], Awaitable[Watch]]


async def test_a_webhook_that_fails_twice_is_told_again_later_under_the_same_id(keep_watch: Keep, clock: Clock) -> None:
    with hook(500, 503) as program:
        watch = await keep_watch(told_by(program))
        alarm = await watch.raise_alarm()
        await watch.look()
        [first] = (await watch.report(alarm)).deliveries
        assert (first.state, first.attempts, first.error) == (DeliveryState.WAITING, 1, "answered HTTP 500")
        await watch.look()
        assert len(program.requests) == 1, "it is not tried again before its time"
        for attempts in (2, 3):
            [before] = (await watch.report(alarm)).deliveries
            assert before.next_try_at is not None
            assert 0.5 <= (before.next_try_at - clock()).total_seconds() / 2.0 ** (attempts - 1) <= 1.0
            clock.at = before.next_try_at
            await watch.look()
            assert len(program.requests) == attempts
    [last] = (await watch.report(alarm)).deliveries
    assert (last.state, last.attempts, last.error, last.id) == (DeliveryState.DELIVERED, 3, "", first.id)
    assert set(program.ids) == {first.id}
    assert program.said[-1]["type"] == "alarm.raised"
    assert program.said[-1]["data"]["mission_id"] == "m1"
    assert program.said[-1]["data"]["message"] == "a is lost: silent"


async def test_what_is_posted_is_signed_as_standard_webhooks_are(keep_watch: Keep, clock: Clock) -> None:
    with hook() as program:
        clock.at = datetime.now(UTC)  # the library refuses what is old
        watch = await keep_watch(told_by(program))
        await watch.raise_alarm()
        await watch.look()
    [(headers, body)] = program.requests
    assert Webhook(SECRET).verify(body, dict(headers)) == program.said[0]
    with pytest.raises(Exception, match="No matching signature"):
        Webhook(SECRET).verify(body.replace(b"lost", b"well"), dict(headers))


async def test_a_webhook_that_sends_on_to_elsewhere_is_not_followed(keep_watch: Keep) -> None:
    with hook(307) as program:
        watch = await keep_watch(told_by(program))
        alarm = await watch.raise_alarm()
        await watch.look()
        [delivery] = (await watch.report(alarm)).deliveries
    assert delivery.error == "answered HTTP 307"
    assert len(program.requests) == 1


async def test_who_does_not_answer_holds_up_nobody_else(keep_watch: Keep, monkeypatch: pytest.MonkeyPatch) -> None:
    with hook() as silent, hook() as well:
        silent.release.clear()
        watch = await keep_watch(told_by(silent, well, routes=[{"to": ["a", "b"]}]))
        one, other = await watch.raise_alarm(), await watch.raise_alarm(AlarmKind.LEAK)
        await watch.dispatcher.look()
        await until(lambda: len(well.requests) == 1, "the other one is told")
        await until(lambda: watch.dispatcher.sending == {"a"}, "only the silent one is waited for")
        await watch.dispatcher.look()
        await until(lambda: len(well.requests) == 2, "the other one is told of the second alarm")
        silent.release.set()
        await watch.sent()
        await watch.look()
        for alarm in (one, other):
            assert {d.state for d in (await watch.report(alarm)).deliveries} == {DeliveryState.DELIVERED}
        assert len(silent.requests) == 2
    monkeypatch.setattr(channels, "PATIENCE_S", 0.05)
    with hook() as silent:
        silent.release.clear()
        third = await keep_watch(told_by(silent))
        late = await third.raise_alarm(AlarmKind.TOO_DEEP)
        await third.look()
        [delivery] = (await third.report(late)).deliveries
    assert delivery.error == "no answer within 0.05 s"


async def test_an_alarm_that_nobody_acknowledges_goes_up_step_by_step(keep_watch_on_either: Keep, clock: Clock) -> None:
    ladder = [{"to": ["a"]}, {"to": ["b", "a"], "after_s": 120}, {"to": ["c"], "after_s": 600}]
    with ExitStack() as stack:
        bridge, captain, shore = (stack.enter_context(hook()) for _ in range(3))
        watch = await keep_watch_on_either(told_by(bridge, captain, shore, routes=ladder))
        alarm = await watch.raise_alarm()
        await watch.look()
        clock.advance(119)
        await watch.look()
        assert (len(bridge.requests), len(captain.requests), len(shore.requests)) == (1, 0, 0)
        clock.advance(1)
        await watch.look()
        assert (len(bridge.requests), len(captain.requests), len(shore.requests)) == (1, 1, 0)
        assert captain.said[0]["type"] == "alarm.escalated"
        report = await watch.dispatcher.acknowledge(alarm.id, "Ana")
        assert (report.state, report.acknowledged_by) == (AlarmState.ACKNOWLEDGED, "Ana")
        clock.advance(1000)
        await watch.look()
    assert shore.requests == [], "who has it is known: nobody else is called"
    for told in (bridge, captain):
        assert [said["type"] for said in told.said][-1] == "alarm.acknowledged"
        assert told.said[-1]["data"]["acknowledged_by"] == "Ana"


async def test_whoever_was_told_hears_that_it_is_over_and_nobody_else_is_called(
    keep_watch_on_either: Keep, clock: Clock
) -> None:
    ladder = [{"to": ["a"]}, {"to": ["b"], "after_s": 120}]
    with hook() as bridge, hook() as shore:
        watch = await keep_watch_on_either(told_by(bridge, shore, routes=ladder))
        alarm = await watch.raise_alarm()
        await watch.look()
        clock.advance(60)
        await watch.end(alarm)
        await watch.look()
        clock.advance(600)
        await watch.look()
        report = await watch.dispatcher.acknowledge(alarm.id, "Ana")
        await watch.look()
    assert report.ended_at == BEGAN + timedelta(seconds=60)
    assert [said["type"] for said in bridge.said] == ["alarm.raised", "alarm.ended", "alarm.acknowledged"]
    assert bridge.said[1]["data"]["ended_at"] is not None
    assert shore.requests == []


async def test_who_does_not_answer_hears_that_it_is_over_after_that_it_was_raised(
    keep_watch_on_either: Keep, clock: Clock
) -> None:
    ladder = [{"to": ["a"]}, {"to": ["b", "c"], "after_s": 60}]
    with hook(*[503] * 8) as bridge, hook() as captain, hook() as shore:
        captain.release.clear()
        watch = await keep_watch_on_either(told_by(bridge, captain, shore, routes=ladder))
        other = await watch.raise_alarm(AlarmKind.LEAK)
        clock.advance(30)
        alarm = await watch.raise_alarm()
        await watch.look()
        clock.advance(30)
        await watch.dispatcher.look()
        await until(lambda: watch.dispatcher.sending == {"b"}, "the captain is being told of the first one")
        clock.advance(30)
        await watch.dispatcher.look()
        await until(lambda: len(shore.requests) == 2, "the others are told of both")
        await watch.end(alarm)
        captain.release.set()
        for _ in range(10):
            await watch.look()
            clock.advance(60)
        told = {(d.recipient, d.notice): d.state for d in (await watch.report(alarm)).deliveries}
    heard = [said["type"] for said in bridge.said if said["data"]["id"] == alarm.id]
    assert set(heard[:-1]) == {"alarm.raised"}
    assert heard[-1] == "alarm.ended"
    assert [said["type"] for said in shore.said if said["data"]["id"] == alarm.id] == ["alarm.escalated", "alarm.ended"]
    assert told == {
        ("a", "raised"): DeliveryState.DELIVERED,
        ("a", "ended"): DeliveryState.DELIVERED,
        ("b", "escalated"): DeliveryState.SUPERSEDED,
        ("c", "escalated"): DeliveryState.DELIVERED,
        ("c", "ended"): DeliveryState.DELIVERED,
    }, "whom nobody had tried to call is called no more"
    assert [said["data"]["id"] for said in captain.said] == [other.id]


async def test_who_never_answers_is_not_told_for_another_day_that_it_is_over(keep_watch: Keep, clock: Clock) -> None:
    with hook(*[500] * 20) as program:
        watch = await keep_watch(told_by(program, give_up_after_s=60))
        alarm = await watch.raise_alarm()
        await watch.look()
        clock.advance(30)
        await watch.end(alarm)
        for _ in range(10):
            await watch.look()
            clock.advance(30)
        told = {d.notice: d.state for d in (await watch.report(alarm)).deliveries}
    assert told == {"raised": DeliveryState.FAILED, "ended": DeliveryState.SUPERSEDED}
    assert {said["type"] for said in program.said} == {"alarm.raised"}


async def test_what_was_over_before_anybody_was_told_is_told_once(keep_watch: Keep) -> None:
    with hook() as program:
        watch = await keep_watch(told_by(program))
        await watch.end(await watch.raise_alarm())
        await watch.look()
        await watch.look()
    assert [said["type"] for said in program.said] == ["alarm.raised"]
    assert program.said[0]["data"]["ended_at"] is not None


async def test_who_was_not_told_yet_is_not_told_of_what_is_taken(keep_watch: Keep) -> None:
    with hook() as program:
        watch = await keep_watch(told_by(program))
        alarm = await watch.raise_alarm()
        await watch.dispatcher.acknowledge(alarm.id, "Ana")
        await watch.look()
        assert (await watch.report(alarm)).deliveries == []
    assert program.requests == []


async def test_what_was_taken_while_it_was_being_told_is_not_told_again_as_raised(
    keep_watch_on_either: Keep, clock: Clock
) -> None:
    with hook(503) as program:
        program.release.clear()
        watch = await keep_watch_on_either(told_by(program))
        alarm = await watch.raise_alarm()
        await watch.dispatcher.look()
        await until(lambda: len(program.requests) == 1, "it is being told")
        await watch.dispatcher.acknowledge(alarm.id, "Ana")
        program.release.set()
        await watch.sent()
        clock.advance(600)
        await watch.look()
        await watch.look()
        told = {d.notice: d.state for d in (await watch.report(alarm)).deliveries}
        assert [said["type"] for said in program.said] == ["alarm.raised", "alarm.acknowledged"]
        assert told == {"raised": DeliveryState.SUPERSEDED, "acknowledged": DeliveryState.DELIVERED}
        # The process that was telling it is killed.
        program.release.clear()
        second = await watch.raise_alarm(AlarmKind.LEAK)
        await watch.dispatcher.look()
        await until(lambda: len(program.requests) == 3, "it is being told")
        await watch.dispatcher.acknowledge(second.id, "Ana")
        await end_of_process(watch)
        program.release.set()
        after = await keep_watch_on_either(told_by(program))
        await after.look()
    assert [said["type"] for said in program.said[2:]] == ["alarm.raised", "alarm.acknowledged"]


async def test_the_first_who_acknowledges_stays_and_unknown_alarms_are_refused(keep_watch: Keep, clock: Clock) -> None:
    watch = await keep_watch(AlarmSettings())
    alarm = await watch.raise_alarm()
    first = await watch.dispatcher.acknowledge(alarm.id, "Ana")
    clock.advance(5)
    assert await watch.dispatcher.acknowledge(alarm.id, "Ben") == first
    with pytest.raises(AlarmNotFoundError, match="there is no alarm 'b2'"):
        await watch.dispatcher.acknowledge("b2", "Ana")
    assert [a.id for a in await watch.dispatcher.alarms(AlarmState.ACKNOWLEDGED, "m1")] == [alarm.id]
    assert await watch.dispatcher.alarms(AlarmState.OPEN) == []


async def test_a_restart_between_alarm_and_delivery_loses_nothing(keep_watch_on_either: Keep, clock: Clock) -> None:
    with hook() as program:
        before = await keep_watch_on_either(told_by(program))
        alarm = await before.raise_alarm()
        await end_of_process(before)  # killed before it looked
        after = await keep_watch_on_either(told_by(program))
        await after.look()
        assert len(program.requests) == 1
        # Killed while it was telling: whether it arrived nobody knows, so it is told again, under the same id.
        program.release.clear()
        second = await after.raise_alarm(AlarmKind.LEAK)
        await after.dispatcher.look()
        await until(lambda: len(program.requests) == 2, "it is being told")
        await end_of_process(after)
        program.release.set()
        last = await keep_watch_on_either(told_by(program))
        await last.look()
        for row in (alarm, second):
            assert [d.state for d in (await last.report(row)).deliveries] == [DeliveryState.DELIVERED]
    assert len(program.requests) == 3
    assert program.ids[1] == program.ids[2] != program.ids[0]


async def test_two_processes_tell_once(keep_watch_on_either: Keep) -> None:
    with hook() as program:
        one, other = await keep_watch_on_either(told_by(program)), await keep_watch_on_either(told_by(program))
        alarms = [await one.raise_alarm(vehicle=f"v{k}") for k in range(6)]
        for _ in range(6):
            await asyncio.gather(one.look(), other.look())
        assert sorted(program.ids) == sorted({d.id for a in alarms for d in (await one.report(a)).deliveries})
    assert len(program.ids) == 6


async def test_the_same_again_is_held_back_while_it_goes_on_and_told_when_that_lasts(
    keep_watch_on_either: Keep, clock: Clock
) -> None:
    with hook() as program:
        watch = await keep_watch_on_either(told_by(program, repeat_after_s=60))
        await watch.raise_alarm()
        await watch.look()
        clock.advance(30)
        again, more = await watch.raise_alarm(), await watch.raise_alarm()
        other = await watch.raise_alarm(vehicle="b")
        await watch.look()
        assert [(await watch.report(row)).deliveries for row in (again, more)] == [[], []]
        assert len((await watch.report(other)).deliveries) == 1
        clock.advance(31)
        later = await watch.raise_alarm()
        await watch.look()
        told = [row for row in (again, more, later) if (await watch.report(row)).deliveries]
        assert len(told) == 1, "one is told for all that were held back"
        assert told[0] in (again, more)
        clock.advance(600)
        await watch.look()
        assert len(await watch.dispatcher.alarms(AlarmState.OPEN)) == 5
    assert len(program.requests) == 3


async def test_what_comes_again_after_it_was_over_is_told_at_once_and_escalated(
    keep_watch_on_either: Keep, clock: Clock
) -> None:
    ladder = [{"to": ["a"]}, {"to": ["b"], "after_s": 120}]
    with hook() as bridge, hook() as captain:
        watch = await keep_watch_on_either(told_by(bridge, captain, routes=ladder))
        first = await watch.raise_alarm()
        await watch.look()
        clock.advance(20)
        await watch.end(first)
        await watch.look()
        clock.advance(20)
        again = await watch.raise_alarm()
        await watch.look()
        assert [said["type"] for said in bridge.said] == ["alarm.raised", "alarm.ended", "alarm.raised"]
        assert bridge.said[-1]["data"]["id"] == again.id
        clock.advance(120)
        await watch.look()
    assert [(said["type"], said["data"]["id"]) for said in captain.said] == [("alarm.escalated", again.id)]


async def test_what_comes_and_goes_is_told_twice_and_then_once_it_stays(
    keep_watch_on_either: Keep, clock: Clock
) -> None:
    ladder = [{"to": ["a"]}, {"to": ["b"], "after_s": 120}, {"to": ["c"], "after_s": 600}]
    with hook() as bridge, hook() as captain, hook() as shore:
        watch = await keep_watch_on_either(told_by(bridge, captain, shore, routes=ladder))
        for _ in range(12):
            await watch.end(await watch.raise_alarm())
            await watch.look()
            clock.advance(5)
            row = await watch.raise_alarm()
            await watch.look()
            clock.advance(5)
            await watch.end(row)
            await watch.look()
        stays = await watch.raise_alarm()
        await watch.look()
        heard = len(bridge.requests)
        assert heard <= 2 * 2
        clock.at = BEGAN + timedelta(seconds=299)
        await watch.look()
        assert len(bridge.requests) == heard
        clock.advance(11)
        await watch.look()
        assert (bridge.said[-1]["type"], bridge.said[-1]["data"]["id"]) == ("alarm.raised", stays.id)
        assert [said["type"] for said in captain.said] == ["alarm.escalated"], "it is open for so long already"
        assert shore.requests == []
        clock.at = stays.raised_at + timedelta(seconds=600)
        await watch.look()
    assert [said["data"]["id"] for said in shore.said] == [stays.id]


async def test_a_delivery_that_fails_for_too_long_is_given_up(keep_watch: Keep, clock: Clock) -> None:
    with hook(*[500] * 20) as program:
        watch = await keep_watch(told_by(program, give_up_after_s=60))
        alarm = await watch.raise_alarm()
        for _ in range(10):
            await watch.look()
            clock.advance(30)
        [delivery] = (await watch.report(alarm)).deliveries
    assert delivery.state is DeliveryState.FAILED
    assert delivery.next_try_at is None
    assert 3 <= delivery.attempts <= 6


async def test_what_cannot_be_stored_goes_out_from_memory_and_is_stored_as_told(
    keep_watch_on_either: Keep, clock: Clock
) -> None:
    with hook() as program:
        watch = await keep_watch_on_either(told_by(program))
        row = make_alarm(AlarmKind.DATABASE_UNWRITABLE, "m1", "nothing can be written down", clock())
        watch.dispatcher.noted(row)
        await watch.dispatcher.look_unstored()
        assert not watch.dispatcher.sending, "it may still be stored in a moment"
        clock.advance(2)
        await watch.dispatcher.look_unstored()
        await watch.sent()
        assert len(program.requests) == 1
        assert [a.id for a in await watch.dispatcher.alarms(AlarmState.OPEN)] == [row.id]
        # The database is well again: the journal stores the alarm, and meanwhile it is acknowledged.
        stored = copy_of(row)
        await watch.dispatcher.acknowledge(row.id, "Ana")
        async with watch.database.writing() as session:
            session.add(stored)
        watch.dispatcher.stored(stored)
        await watch.look()
        report = await watch.report(row)
    assert report.acknowledged_by == "Ana"
    assert {(d.notice, d.state) for d in report.deliveries} == {
        ("raised", DeliveryState.DELIVERED),
        ("acknowledged", DeliveryState.DELIVERED),
    }
    assert [said["type"] for said in program.said] == ["alarm.raised", "alarm.acknowledged"]


async def test_a_test_goes_where_the_routes_say_or_to_one(keep_watch: Keep) -> None:
    with hook() as bridge, hook() as shore:
        watch = await keep_watch(told_by(bridge, shore, routes=[{"to": ["a"], "severity": "major"}]))
        assert (await watch.dispatcher.test("Ana", AlarmSeverity.MINOR)).deliveries == []
        report = await watch.dispatcher.test("Ana", AlarmSeverity.CRITICAL)
        assert [d.recipient for d in report.deliveries] == ["a"]
        assert [d.recipient for d in (await watch.dispatcher.test("Ana", AlarmSeverity.MINOR, "b")).deliveries] == ["b"]
        await watch.look()
        with pytest.raises(InvalidRequestError, match="there is no recipient 'nobody'"):
            await watch.dispatcher.test("Ana", AlarmSeverity.MINOR, "nobody")
    assert (len(bridge.requests), len(shore.requests)) == (1, 1)
    assert bridge.said[0]["data"]["kind"] == "test"


async def test_errors_say_why_without_the_address(keep_watch: Keep, clock: Clock) -> None:
    with hook() as gone:
        settings = told_by(gone)
    watch = await keep_watch(settings)
    alarm = await watch.raise_alarm()
    await watch.look()
    [delivery] = (await watch.report(alarm)).deliveries
    assert "ConnectError" in delivery.error
    assert gone.url not in delivery.error
