"""Where alarms arrive, go out and are acknowledged: one in each process, together one for all of them."""

import asyncio
import random
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from datetime import datetime, timedelta
from typing import Any
from weakref import WeakValueDictionary

import structlog
from sqlalchemy.exc import SQLAlchemyError

from app.missions import clock, metrics
from app.missions.alarm_kinds import AlarmKind, AlarmSeverity
from app.missions.alarm_settings import AlarmSettings
from app.missions.alarms import outbox
from app.missions.alarms.channels import Channels, DeliveryError
from app.missions.alarms.outbox import Attempt
from app.missions.alarms.raised import AlarmBoard, alarm_view, make_alarm
from app.missions.errors import AlarmNotFoundError, InvalidRequestError
from app.missions.views.alarms import AlarmReport, AlarmState, DeliveryState, DeliveryView, Notice
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.database import Database
from app.storage.models import AlarmDeliveryRow, AlarmRow
from app.storage.queries import alarms as alarm_queries

PERIOD_S = 1.0
"""How often is looked for what another process did, and for what is due."""
UNSTORED_S = 2.0
"""An alarm that could not be stored for so long goes out all the same."""
MOST_AT_ONCE = 16
"""Attempts at the same time; never two to the same recipient, so that one that hangs holds up nobody else."""
MOST_UNSTORED = 1000
"""Alarms that wait in memory for the database, the oldest are given up first: their lines wait in the journals too."""
FIRST_WAIT_S, LONGEST_WAIT_S = 2.0, 300.0
"""Waits between attempts double, from the first to the longest."""
MOST_SHOWN = 500
CLOSING_S = 2.0

log = structlog.get_logger(__name__)


class AlarmDispatcher:
    """Tells whoever is to be told, and keeps who acknowledged.

    Parameters
    ----------
    process
        Returns the number of this process among those that share the database; 0 while it has none.
    now
        The wall clock.
    chance
        Spreads the times of further attempts.
    """

    def __init__(
        self,
        settings: AlarmSettings,
        database: Database,
        process: Callable[[], int],
        *,
        now: Callable[[], datetime] = clock.now,
        chance: random.Random | None = None,
    ) -> None:
        self._settings = settings
        self._database = database
        self._process = process
        self._now = now
        self._chance = chance or random.Random()  # noqa: S311 - nothing secret
        self._channels = Channels(settings)
        self._boards: WeakValueDictionary[str, AlarmBoard] = WeakValueDictionary()
        self._names: dict[str, str] = {}
        self._unstored: dict[str, tuple[AlarmRow, datetime]] = {}
        """Alarms that wait for the database, and since when."""
        self._begun: dict[str, AlarmDeliveryRow] = {}
        """Deliveries of those."""
        self._acknowledged: list[tuple[str, str]] = []
        """Alarms that were acknowledged while they were being stored, and by whom."""
        self._outcomes: list[tuple[str, int, dict[str, Any]]] = []
        """Of attempts, not written yet."""
        self._sending: dict[str, tuple[str, asyncio.Task[None]]] = {}
        """By delivery: to whom, and the attempt."""
        self._news, self._unstored_news = asyncio.Event(), asyncio.Event()
        self._keepers: list[asyncio.Task[None]] = []
        self._fault = ""

    # What missions say

    def listen(self, board: AlarmBoard, mission_name: str) -> None:
        """Show on this board what becomes of its mission's alarms."""
        self._boards[board.mission_id] = board
        self._names[board.mission_id] = mission_name
        self._news.set()

    def noted(self, row: AlarmRow) -> None:
        """Take an alarm that is not stored yet; it goes out when that takes long."""
        self._unstored[row.id] = row, self._now()
        while len(self._unstored) > MOST_UNSTORED:
            self._unstored.pop(next(iter(self._unstored)))
        self._unstored_news.set()

    def stored(self, row: AlarmRow) -> None:
        """Take an alarm that was stored."""
        self._let_go(row.id)
        self._news.set()

    def _let_go(self, alarm_id: str) -> None:
        """Keep an alarm no longer in memory: the database has it."""
        row, _ = self._unstored.pop(alarm_id, (None, None))
        if row is not None and row.acknowledged_by is not None:
            self._acknowledged.append((alarm_id, row.acknowledged_by))

    # What people say

    async def alarms(
        self, state: AlarmState | None = None, mission_id: str | None = None, limit: int = 200
    ) -> list[AlarmReport]:
        """Return alarms with what was told of them, newest first; those, too, that could not be stored yet."""
        acknowledged = None if state is None else state is AlarmState.ACKNOWLEDGED
        async with self._database.reading() as session:
            rows = await alarm_queries.newest(session, acknowledged=acknowledged, mission_id=mission_id, limit=limit)
            told = await alarm_queries.deliveries_of(session, [row.id for row in rows])
        known = {row.id for row in rows}
        waiting = [row for row, _ in self._unstored.values() if row.id not in known]
        waiting = [
            row
            for row in waiting
            if (acknowledged is None or acknowledged == (row.acknowledged_at is not None))
            and (mission_id is None or row.mission_id == mission_id)
        ]
        found = sorted([*rows, *waiting], key=lambda row: row.raised_at, reverse=True)[:limit]
        return [_report(row, [*told, *self._begun.values()]) for row in found]

    async def alarm(self, alarm_id: str) -> AlarmReport:
        """Return an alarm with what was told of it. Raises AlarmNotFoundError."""
        async with self._database.reading() as session:
            rows = await alarm_queries.of_ids(session, [alarm_id])
            told = await alarm_queries.deliveries_of(session, [alarm_id])
        waiting = self._unstored.get(alarm_id)
        if not rows and waiting is None:
            raise _not_found(alarm_id)
        return _report(rows[0] if rows else waiting[0], [*told, *self._begun.values()])  # type: ignore[index]

    async def acknowledge(self, alarm_id: str, actor: str) -> AlarmReport:
        """Note who has taken an alarm; the first one stays. Raises AlarmNotFoundError."""
        waiting = self._unstored.get(alarm_id)
        if waiting is not None:
            row = waiting[0]
            if row.acknowledged_at is None:
                row.acknowledged_at, row.acknowledged_by = self._now(), actor
                self._show(row)
            return _report(row, self._begun.values())
        await to_the_end(self._acknowledge(alarm_id, actor))
        self._news.set()
        return await self.alarm(alarm_id)

    async def _acknowledge(self, alarm_id: str, actor: str) -> None:
        async with self._database.writing() as session:
            row = await alarm_queries.held(session, alarm_id)
            if row is None:
                raise _not_found(alarm_id)
            if row.acknowledged_at is None:
                await outbox.acknowledge(session, self._settings, row, actor, self._now())
        self._show(row)

    async def test(self, actor: str, severity: AlarmSeverity, to: str | None = None) -> AlarmReport:
        """Raise an alarm to try who is told: those of the routes, or one recipient. Raises InvalidRequestError."""
        if to is not None and to not in self._settings.recipients:
            known = ", ".join(sorted(self._settings.recipients)) or "none"
            raise InvalidRequestError("to", f"there is no recipient {to!r}", f"recipients in the settings: {known}")
        at = self._now()
        row = make_alarm(AlarmKind.TEST, None, f"this is a test, asked for by {actor}", at)
        row.severity = severity
        await to_the_end(self._store_test(row, to, at))
        self._news.set()
        return await self.alarm(row.id)

    async def _store_test(self, row: AlarmRow, to: str | None, at: datetime) -> None:
        made, row.next_at = outbox.deliveries(self._settings, row, "", at)
        row.told_after_s = 0.0
        if to is not None:
            made, row.next_at = [outbox.new_delivery(row.id, to, Notice.RAISED, at)], None
        async with self._database.writing() as session:
            session.add(row)
            await session.flush()
            await alarm_queries.add_deliveries(session, made)

    def _show(self, row: AlarmRow) -> None:
        board = self._boards.get(row.mission_id or "")
        if board is not None:
            board.show(alarm_view(row))

    # What goes out

    def start(self) -> None:
        """Keep at it from now on."""
        self._keepers = [
            asyncio.create_task(self._keep(self.look, self._news), name="alarms"),
            asyncio.create_task(self._keep(self.look_unstored, self._unstored_news), name="alarms not stored"),
        ]

    async def close(self) -> None:
        """End; what was under way is tried again by the next process, under the same id."""
        tasks = [*self._keepers, *(task for _, task in self._sending.values())]
        for task in tasks:
            task.cancel()
        if tasks:
            # Some still take leave of the other side, which may be silent.
            await asyncio.wait(tasks, timeout=CLOSING_S)
        if self._outcomes:
            with suppress(SQLAlchemyError, OSError, TimeoutError):
                async with asyncio.timeout(CLOSING_S):
                    await to_the_end(self._write([]))
        await self._channels.close()

    async def _keep(self, look: Callable[[], Awaitable[None]], news: asyncio.Event) -> None:
        while True:
            news.clear()
            try:
                await look()
                self._fault = ""
            except (SQLAlchemyError, OSError) as error:
                if str(error) != self._fault:
                    self._fault = str(error)
                    log.error("alarms cannot be looked after, trying again", error=str(error))
            except Exception:
                log.exception("alarms cannot be looked after, trying again")
            with suppress(TimeoutError):
                async with asyncio.timeout(PERIOD_S):
                    await news.wait()

    async def look(self) -> None:
        """Look once what is stored: show it, plan it, take it and send it."""
        await self._show_what_changed()
        if not self._process():
            return
        waiting = {*self._unstored, *(row.alarm_id for row in self._begun.values())}
        async with self._database.reading() as session:
            needed = await alarm_queries.anything_to_do(session, self._now())
            needed = needed or bool(await alarm_queries.of_ids(session, waiting))
        if needed or self._outcomes or self._acknowledged:
            taken: list[Attempt] = []
            await to_the_end(self._write(taken))
            for attempt in taken:
                self._begin(attempt)

    async def _write(self, taken: list[Attempt]) -> None:
        """Write in one transaction what came of attempts and what is planned; ``taken`` gets what is to be sent."""
        at, process = self._now(), self._process()
        outcomes, late = list(self._outcomes), list(self._acknowledged)
        sending = {delivery_id: recipient for delivery_id, (recipient, _) in self._sending.items()}
        begun, waiting = list(self._begun.values()), list(self._unstored)
        for row in begun:
            # What is under way just now is this process's, as if it had been taken.
            row.process_id = process if row.id in sending else None
        async with self._database.writing() as session:
            for delivery_id, taken_by, values in outcomes:
                # That it arrived is true whoever is at it now.
                arrived = values.get("state") == DeliveryState.DELIVERED
                await alarm_queries.settle(
                    session, delivery_id, process=None if arrived else taken_by or process, values=values
                )
            # Whoever stored an alarm may not have had the time to say so.
            known = await outbox.keep_begun(session, begun, waiting)
            for alarm_id, actor in late:
                alarm = await alarm_queries.held(session, alarm_id)
                if alarm is not None:
                    await outbox.acknowledge(session, self._settings, alarm, actor, at)
            await outbox.plan(session, self._settings, at)
            rows = await outbox.take(session, at, process, set(sending.values()), MOST_AT_ONCE - len(sending))
            taken += await outbox.attempts(session, rows, process)
        del self._outcomes[: len(outcomes)], self._acknowledged[: len(late)]
        for alarm_id in known:
            self._let_go(alarm_id)
        for row in begun:
            if row.alarm_id not in known:
                continue
            del self._begun[row.id]
            if row.id in sending and row.id not in self._sending:
                # It ended while this was written.
                ended = {name: getattr(row, name) for name in ("state", "attempts", "next_try_at", "done_at", "error")}
                self._outcomes.append((row.id, process, ended | {"process_id": None}))

    async def look_unstored(self) -> None:
        """Look once at alarms that the database does not take: they go out from memory."""
        at = self._now()
        for row, since in list(self._unstored.values()):
            if (at - since).total_seconds() < UNSTORED_S or row.acknowledged_at is not None:
                continue
            made, _ = outbox.deliveries(self._settings, row, self._names.get(row.mission_id or "", ""), at)
            for delivery in made:
                self._begun.setdefault(delivery.id, delivery)
        busy = {recipient for recipient, _ in self._sending.values()}
        for delivery in list(self._begun.values()):
            waiting = self._unstored.get(delivery.alarm_id)
            ready = delivery.state == DeliveryState.WAITING and delivery.next_try_at <= at
            if waiting is None or not ready or delivery.recipient in busy or len(self._sending) >= MOST_AT_ONCE:
                continue
            row = waiting[0]
            busy.add(delivery.recipient)
            self._begin(outbox.attempt_of(delivery, row, self._names.get(row.mission_id or "", ""), 0))

    def _begin(self, attempt: Attempt) -> None:
        if attempt.message.id in self._sending:
            return
        task = asyncio.create_task(self._attempt(attempt), name=f"alarm to {attempt.recipient}")
        self._sending[attempt.message.id] = attempt.recipient, task

    async def _attempt(self, attempt: Attempt) -> None:
        """Send once, and note what came of it."""
        message = attempt.message
        try:
            await self._channels.send(attempt.recipient, message, self._now())
        except DeliveryError as error:
            values = self._again(attempt, str(error))
            log.warning("alarm not delivered", recipient=attempt.recipient, alarm=message.alarm.id, why=str(error))
        else:
            values = {"state": DeliveryState.DELIVERED, "done_at": self._now(), "error": ""}
        values |= {"attempts": attempt.attempts + 1, "process_id": None}
        result = values.get("state", "retried")
        metrics.ALARM_DELIVERIES.labels(str(result)).inc()
        begun = self._begun.get(message.id)
        if begun is not None:
            for name, value in values.items():
                setattr(begun, name, value)
        else:
            self._outcomes.append((message.id, attempt.process, values))
        del self._sending[message.id]
        self._news.set()
        self._unstored_news.set()

    def _again(self, attempt: Attempt, why: str) -> dict[str, Any]:
        """Return when a delivery that failed is tried again, if it is."""
        at = self._now()
        if (at - attempt.created_at).total_seconds() >= self._settings.give_up_after_s:
            return {"state": DeliveryState.FAILED, "done_at": at, "error": why}
        wait_s = min(LONGEST_WAIT_S, FIRST_WAIT_S * 2.0 ** min(attempt.attempts, 20))
        # Spread, so that what failed together does not come together again.
        return {"next_try_at": at + timedelta(seconds=wait_s * self._chance.uniform(0.5, 1.0)), "error": why}

    @property
    def sending(self) -> set[str]:
        """To whom something is being sent just now."""
        return {recipient for recipient, _ in self._sending.values()}

    async def _show_what_changed(self) -> None:
        """Bring the boards of this process up to date: another one may have taken an acknowledgement."""
        boards = dict(self._boards)
        if not boards:
            return
        shown = {alarm.id for board in boards.values() for alarm in board.open}
        async with self._database.reading() as session:
            rows = list(await alarm_queries.newest(session, acknowledged=False, limit=MOST_SHOWN))
            gone = shown - {row.id for row in rows} - self._unstored.keys()
            rows += await alarm_queries.of_ids(session, gone)
        for row in reversed(rows):
            if row.acknowledged_at is not None or row.ended_at is not None or row.id not in shown:
                self._show(row)


def _report(row: AlarmRow, deliveries: "Sequence[AlarmDeliveryRow] | Any") -> AlarmReport:
    told: dict[str, DeliveryView] = {}
    for delivery in deliveries:
        if delivery.alarm_id == row.id:
            told.setdefault(delivery.id, _delivery_view(delivery))
    return AlarmReport(**dict(alarm_view(row)), deliveries=list(told.values()))


def _delivery_view(row: AlarmDeliveryRow) -> DeliveryView:
    waiting = row.state == DeliveryState.WAITING
    return DeliveryView(
        id=row.id,
        recipient=row.recipient,
        notice=Notice(row.notice),
        state=DeliveryState(row.state),
        attempts=row.attempts,
        created_at=row.created_at,
        next_try_at=row.next_try_at if waiting else None,
        done_at=row.done_at,
        error=row.error,
    )


def _not_found(alarm_id: str) -> AlarmNotFoundError:
    return AlarmNotFoundError(f"there is no alarm {alarm_id[:64]!r}", "GET /api/v1/alarms lists all")
