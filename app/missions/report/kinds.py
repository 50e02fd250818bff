"""The files that a report can be had as."""

from collections.abc import Callable
from dataclasses import dataclass

from app.missions.report.document import Document
from app.missions.report.page import html
from app.missions.report.print import pdf


@dataclass(frozen=True)
class ReportKind:
    """A kind of file."""

    extension: str
    media_type: str
    title: str
    make: Callable[[Document], bytes]


REPORTS = {
    kind.extension: kind
    for kind in (
        ReportKind("pdf", "application/pdf", "the survey's report, for print and archive", pdf),
        ReportKind("html", "text/html; charset=utf-8", "the survey's report as a web page in one file", html),
    )
}
"""Every kind by its extension."""
