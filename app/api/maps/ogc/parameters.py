"""Parameters of requests for features: what the standard allows, and nothing else."""

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

from starlette.datastructures import QueryParams

from app.api.http.problems import ProblemError
from app.api.maps.ogc.crs import CRS84, boxes_of
from app.missions.operations.maps.features import Wanted

USUAL_LIMIT, MOST_LIMIT = 500, 5000
FORMAT = "f"
"""Some programs always send it; JSON is all that there is."""
MOST_OF_AN_ID = 200

_FULL_DATE = len("2026-11-23")


@dataclass(frozen=True)
class ItemsQuery:
    """What is asked for of a collection. ``after`` empty: from the beginning."""

    wanted: Wanted
    mission: str | None
    crs: str
    limit: int
    after: str


def check_names(query: QueryParams, known: Collection[str] = ()) -> None:
    """Refuse parameters that there are none of, or that come twice. Raises ProblemError."""
    allowed = {*known, FORMAT}
    for name in query:
        if name not in allowed:
            raise ProblemError(
                "invalid-parameter",
                f"there is no parameter {name[:40]!r} here",
                remedy="Use " + ", ".join(sorted(allowed)),
            )
        if len(query.getlist(name)) > 1:
            raise _wrong(name, "is given twice", "Give it once")
    if query.get(FORMAT, "json").lower() not in ("json", "geojson"):
        raise _wrong(FORMAT, "is not json", "Leave it out")


def crs_of(query: QueryParams, name: str, offered: Collection[str]) -> str:
    """Return the system that a parameter names. Raises ProblemError for one that is not offered."""
    found = query.get(name, CRS84)
    if found not in offered:
        raise _wrong(name, f"is {found[:100]!r}", "Use one of " + ", ".join(offered))
    return found


def items_query(query: QueryParams, queryables: Collection[str], offered: Collection[str]) -> ItemsQuery:
    """Return what is asked for of a collection. Raises ProblemError."""
    check_names(query, {"bbox", "bbox-crs", "crs", "datetime", "limit", "after", *queryables})
    crs, box_crs = crs_of(query, "crs", offered), crs_of(query, "bbox-crs", offered)
    wanted = Wanted(vehicle=query.get("vehicle"), state=query.get("state"))
    if "bbox" in query:
        wanted = replace(wanted, boxes=boxes_of(_numbers(query["bbox"]), box_crs))
    if "datetime" in query:
        from_s, until_s = _period(query["datetime"])
        wanted = replace(wanted, from_s=from_s, until_s=until_s)
    after = query.get("after", "")
    if len(after) > MOST_OF_AN_ID:
        raise _wrong("after", "is too long", "Follow the link next of a page")
    return ItemsQuery(wanted, query.get("mission"), crs, _limit(query), after)


def _limit(query: QueryParams) -> int:
    text = query.get("limit", str(USUAL_LIMIT))
    if not (text.isascii() and text.isdigit() and len(text) <= 12 and int(text) >= 1):
        raise _wrong("limit", f"is {text[:20]!r}", "Give a whole number above 0")
    return min(int(text), MOST_LIMIT)


def _numbers(text: str) -> list[float]:
    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) not in (4, 6) or not all(map(math.isfinite, numbers)):
        raise _wrong("bbox", f"is {text[:60]!r}", "Give four numbers, or six with heights, with commas between")
    return numbers


def _period(text: str) -> tuple[float | None, float | None]:
    parts = text.split("/")
    if len(parts) == 1:
        first, last = _instant(text)
        return first, last
    if len(parts) != 2:
        raise _wrong("datetime", f"is {text[:60]!r}", "Give a time, or two with a slash between")
    begin, end = (None if part in ("", "..") else _instant(part) for part in parts)
    if begin is None and end is None and text not in ("../..", "/..", "../", "/"):
        raise _wrong("datetime", f"is {text[:60]!r}", "Give at least one time")
    if begin is not None and end is not None and begin[0] > end[1]:
        raise _wrong("datetime", "ends before it begins", "Give the earlier time first")
    return None if begin is None else begin[0], None if end is None else end[1]


def _instant(text: str) -> tuple[float, float]:
    """Return the first and the last moment of a time or a day, Unix seconds."""
    try:
        # As RFC 3339 has it; Python takes more than that.
        if len(text) == _FULL_DATE:
            day = datetime.strptime(text, "%Y-%m-%d").replace(tzinfo=UTC)
            return day.timestamp(), (day + timedelta(days=1)).timestamp() - 1e-3
        if text[10:11] not in ("T", "t", " ") or len(text) < len("2026-11-23T10:00:00Z"):
            raise ValueError
        at = datetime.fromisoformat(text.upper())
        if at.tzinfo is None:
            raise ValueError
        # Times in features are cut to the millisecond.
        return at.timestamp() - 5e-4, at.timestamp() + 5e-4
    except (ValueError, OverflowError):
        raise _wrong("datetime", f"has {text[:40]!r}", "Give times as 2026-11-23T10:00:00Z") from None


def _wrong(name: str, what: str, remedy: str) -> ProblemError:
    return ProblemError("invalid-parameter", f"{name} {what}", remedy=remedy)
