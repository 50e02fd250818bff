"""What somebody is told of an alarm: as JSON for programs, as text for people."""

import json
from dataclasses import dataclass
from datetime import datetime
from email.message import EmailMessage
from typing import Any

from app.missions.alarm_kinds import ALARMS
from app.missions.views.alarms import AlarmView, Notice

MAIL_DOMAIN = "bathyfleet.invalid"
"""Of message ids: what is told twice has the same, and nobody's domain is in it."""

_TITLES = {
    Notice.RAISED: "",
    Notice.ESCALATED: "NOT ACKNOWLEDGED: ",
    Notice.ACKNOWLEDGED: "acknowledged: ",
    Notice.ENDED: "over: ",
}


@dataclass(frozen=True, slots=True)
class Message:
    """What one recipient is told.

    Attributes
    ----------
    id
        Of the delivery: the same at every attempt.
    """

    id: str
    notice: Notice
    alarm: AlarmView
    mission_name: str

    def body(self, at: datetime) -> bytes:
        """Return it as JSON, as Standard Webhooks advise: type, timestamp and data."""
        content: dict[str, Any] = {
            "type": f"alarm.{self.notice}",
            "timestamp": at.isoformat(),
            "id": self.id,
            "data": self.alarm.model_dump(mode="json")
            | {"mission_name": self.mission_name, "action": ALARMS[self.alarm.kind].action},
        }
        return json.dumps(content, separators=(",", ":")).encode()

    @property
    def subject(self) -> str:
        """One line that says what it is about."""
        where = f" ({self.mission_name})" if self.mission_name else ""
        said = " ".join(f"{_TITLES[self.notice]}{self.alarm.message}{where}".split())
        return f"[{self.alarm.severity.upper()}] {said}"[:200]

    @property
    def text(self) -> str:
        """Everything that people need to know."""
        alarm = self.alarm
        lines = [
            alarm.message,
            "",
            f"Alarm:     {alarm.kind} ({alarm.severity})",
            f"Raised:    {alarm.raised_at:%Y-%m-%d %H:%M:%S} UTC",
            f"Mission:   {self.mission_name or '-'}",
            f"Vehicle:   {alarm.vehicle or '-'}",
            f"To do:     {ALARMS[alarm.kind].action}",
            f"Alarm id:  {alarm.id}",
        ]
        if alarm.ended_at is not None:
            lines.insert(4, f"Over since {alarm.ended_at:%Y-%m-%d %H:%M:%S} UTC")
        if alarm.acknowledged_at is not None:
            lines.insert(4, f"Acknowledged by {alarm.acknowledged_by} at {alarm.acknowledged_at:%Y-%m-%d %H:%M:%S} UTC")
        elif self.notice is Notice.ESCALATED:
            lines.insert(4, "Nobody has acknowledged it: you are the next to be told.")
        return "\n".join(lines) + "\n"

    def email(self, sender: str, to: tuple[str, ...], at: datetime) -> EmailMessage:
        """Return it as an e-mail, under the delivery's id."""
        mail = EmailMessage()
        mail["Subject"] = self.subject
        mail["From"] = sender
        mail["To"] = ", ".join(to)
        mail["Date"] = at
        mail["Message-ID"] = f"<{self.id}@{MAIL_DOMAIN}>"
        mail["Auto-Submitted"] = "auto-generated"
        if self.alarm.severity != "minor":
            mail["Importance"] = "high"
        mail.set_content(self.text)
        return mail
