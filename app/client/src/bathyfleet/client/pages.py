"""Listings that are answered in pages: which one comes after another."""

from __future__ import annotations

from typing import Any

from bathyfleet.client.models import AuditEntry, MissionSummary, StepView


def next_page(page: Any) -> dict[str, int | str] | None:
    """Return the parameters that ask for the page after this one; None after the last one."""
    if not isinstance(page, list):
        return None if page.next_after is None else {"after": page.next_after}
    if not page:
        return None
    match page[-1]:
        case AuditEntry(id=id_) | MissionSummary(id=id_):
            return {"before": id_}
        case StepView(number=number):
            return {"after": number}
        case entry:
            return {"after": entry.id}
