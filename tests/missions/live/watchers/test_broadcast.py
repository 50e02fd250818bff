"""Watchers get every event; of positions only the newest."""

import asyncio
from datetime import UTC, datetime

import pytest

from app.missions.live.watchers import broadcast
from app.missions.live.watchers.broadcast import Broadcaster, Subscription, WatchEndedError
from app.missions.live.watchers.feed import live_period_s
from app.missions.views.messages import EventMessage, LiveMessage, VehiclesMessage, WaypointsMessage
from app.missions.views.mission import EventView, Level

TIME = datetime(2026, 6, 1, tzinfo=UTC)


def event(number: int) -> EventMessage:
    view = EventView(id=number, mission_id="m", time=TIME, level=Level.INFO, kind="step", message=str(number))
    return EventMessage(event=view)


def positions(second: int) -> VehiclesMessage:
    return VehiclesMessage(time=TIME.replace(second=second), vehicles=[])


async def take(subscription: Subscription, count: int) -> list[LiveMessage]:
    messages: list[LiveMessage] = []
    async with asyncio.timeout(30):
        async for message in subscription:
            messages.append(message)
            if len(messages) == count:
                break
    return messages


async def test_a_slow_watcher_loses_positions_but_never_an_event() -> None:
    broadcaster = Broadcaster()
    with broadcaster.subscribe() as slow:
        for i in range(50):
            broadcaster.publish(event(i))
            broadcaster.publish(positions(i))
            broadcaster.publish(WaypointsMessage(waypoints=[]))
        messages = await take(slow, 101)
        assert [m.event.id for m in messages if isinstance(m, EventMessage)] == list(range(50))
        assert sum(isinstance(m, WaypointsMessage) for m in messages) == 50
        assert [m.time.second for m in messages if isinstance(m, VehiclesMessage)] == [49]
        broadcaster.publish(event(50))
        assert await take(slow, 1) == [event(50)]


async def test_watchers_do_not_wait_for_each_other() -> None:
    broadcaster = Broadcaster()
    with broadcaster.subscribe(), broadcaster.subscribe() as quick:
        for i in range(10):
            broadcaster.publish(event(i))
            assert await take(quick, 1) == [event(i)]


async def test_a_watcher_that_never_takes_anything_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(broadcast, "MAX_BACKLOG", 20)
    broadcaster = Broadcaster()
    with broadcaster.subscribe() as stuck:
        for i in range(21):
            broadcaster.publish(event(i))
        with pytest.raises(WatchEndedError, match="more than 20 messages"):
            await take(stuck, 1)


async def test_messages_published_while_one_is_handled_come_next() -> None:
    broadcaster = Broadcaster()
    with broadcaster.subscribe() as subscription:
        broadcaster.publish(event(0))
        seen = []
        async with asyncio.timeout(30):
            async for message in subscription:
                assert isinstance(message, EventMessage)
                seen.append(message.event.id)
                if len(seen) == 6:
                    break
                broadcaster.publish(event(len(seen)))
        assert seen == [0, 1, 2, 3, 4, 5]


def test_nobody_watches_after_the_last_one_left() -> None:
    broadcaster = Broadcaster()
    assert not broadcaster.watched
    with broadcaster.subscribe():
        assert broadcaster.watched
        assert broadcaster.viewers == 1
    assert not broadcaster.watched
    broadcaster.publish(event(1))


def test_positions_are_sent_five_times_a_second_to_some_and_no_less_than_once_to_any_crowd() -> None:
    periods = [live_period_s(viewers) for viewers in (1, 10, 50, 200, 5000)]
    assert periods[:2] == [0.2, 0.2]
    assert periods == sorted(periods)
    assert periods[2] == pytest.approx(0.6)
    assert periods[-1] == pytest.approx(1.0)
