"""The alarms of a mission that nobody has acknowledged, as everyone who watches it sees them."""

from collections.abc import Collection, Iterable
from datetime import datetime

from app.missions.alarm_kinds import AlarmKind
from app.missions.alarms.raised import AlarmWatch, alarm_view
from app.missions.live.watchers.broadcast import Broadcaster
from app.missions.views.alarms import AlarmState, AlarmView
from app.missions.views.messages import AlarmMessage
from app.storage.models import AlarmRow

MOST_SHOWN = 500
"""At most so many alarms are shown, the newest; all are in the list of the service."""


class MissionAlarms:
    """Shows alarms as they are raised and acknowledged, also those that cannot be stored at the moment.

    Attributes
    ----------
    watch
        Told of every alarm; None in a process that tells nobody.
    """

    def __init__(self, mission_id: str, broadcaster: Broadcaster) -> None:
        self.mission_id = mission_id
        self.watch: AlarmWatch | None = None
        self._broadcaster = broadcaster
        self._open: dict[str, AlarmView] = {}
        self._standing: set[tuple[str, str | None]] = set()

    def recall(self, rows: Iterable[AlarmRow]) -> None:
        """Take up the alarms that an earlier process raised and that are not over."""
        self._standing |= {(row.kind, row.vehicle) for row in rows}

    def standing(self, kinds: Iterable[AlarmKind]) -> set[tuple[AlarmKind, str | None]]:
        """Return which alarms of some kinds were raised and are not over, acknowledged or not, each with its vehicle.

        What ends them when it is over may not be what raised them: a mission was paused meanwhile, or taken up anew.
        """
        asked = set(kinds)
        return {(AlarmKind(kind), vehicle) for kind, vehicle in self._standing if kind in asked}

    @property
    def open(self) -> list[AlarmView]:
        """Those that nobody has acknowledged, oldest first."""
        return sorted(self._open.values(), key=lambda alarm: alarm.raised_at)

    def noted(self, row: AlarmRow) -> None:
        """Show an alarm that will be stored when that is possible."""
        self._stands(row)
        self.show(alarm_view(row))
        if self.watch is not None:
            self.watch.noted(row)

    def stored(self, row: AlarmRow) -> None:
        """Show an alarm that was stored."""
        self._stands(row)
        self.show(alarm_view(row))
        if self.watch is not None:
            self.watch.stored(row)

    def ended(self, kinds: Collection[str], vehicle: str | None, at: datetime) -> None:
        """Show that what raised the alarms of some kinds is over; they stay until they are acknowledged."""
        self._standing -= {(kind, vehicle) for kind in kinds}
        for alarm in self.open:
            if alarm.kind in kinds and alarm.vehicle == vehicle and alarm.ended_at is None:
                self.show(alarm.model_copy(update={"ended_at": at}))

    def _stands(self, row: AlarmRow) -> None:
        if row.ended_at is None:
            self._standing.add((row.kind, row.vehicle))

    def show(self, alarm: AlarmView) -> None:
        """Show an alarm as it is now; whoever sees it so already is told nothing."""
        known = self._open.get(alarm.id)
        if alarm.state is AlarmState.OPEN:
            self._open[alarm.id] = alarm
            while len(self._open) > MOST_SHOWN:
                self._open.pop(next(iter(self._open)))
        elif known is None:
            return
        else:
            del self._open[alarm.id]
        if alarm != known:
            self._broadcaster.publish(AlarmMessage(alarm=alarm))
