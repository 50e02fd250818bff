"""What is answered about soundings, batches of them and logs."""

from collections.abc import Mapping
from datetime import datetime
from enum import StrEnum

from pydantic import Field

from app.missions.spec.base import Latitude, Longitude
from app.missions.spec.water import ProfileDepth, ProfileSpeed
from app.missions.views.base import View


class Verdict(StrEnum):
    """What happened to one measurement."""

    ACCEPTED = "accepted"
    REJECTED = "rejected"
    """Stored with the reason, not used for the map."""
    DUPLICATE = "duplicate"
    """Already there; nothing stored."""


class Ruling(StrEnum):
    """What an operator said of a sounding."""

    RESTORED = "restored"
    """It counts, whatever gate and map think of it."""
    REJECTED = "rejected"
    """It does not count."""


class SoundingState(StrEnum):
    """Whether a sounding is in the map, and who decided that."""

    USED = "used"
    RESTORED = "restored"
    """Used because an operator restored it."""
    REJECTED = "rejected"
    """Kept out by the gate."""
    DOUBTED = "doubted"
    """Left out of the map because its neighbours say otherwise."""
    WITHDRAWN = "withdrawn"
    """Kept out by an operator."""


class SoundingView(View):
    """A stored sounding; what was measured never changes, only whether it counts."""

    id: int
    vehicle: str
    time_s: float = Field(description="The vehicle's clock, Unix seconds")
    beam: int
    step: int
    lat_deg: float
    lon_deg: float
    range_m: float
    raw_depth_m: float = Field(description="Of the bottom below the surface, as measured")
    depth_m: float | None = Field(description="Corrected, below the datum; null where no correction could be made")
    sd_m: float | None
    state: SoundingState
    reason: str = Field(description="Why it is not used, or who restored it")


class SoundingPage(View):
    """Some soundings, in the order they came."""

    total: int = Field(description="Of all pages")
    items: list[SoundingView]
    next_after: int | None = Field(description="Give it as `after` for the next page; null: this is the last")


class SoundingPoints(View):
    """Many soundings as points, column by column, in the order they came."""

    total: int = Field(description="Of all pages")
    id: list[int]
    lon_deg: list[float]
    lat_deg: list[float]
    depth_m: list[float] = Field(description="Below the datum of the map; as it was measured where that is not known")
    state: list[int] = Field(description="Places in `states`")
    vehicle: list[int] = Field(description="Places in `vehicles`")
    states: list[SoundingState]
    vehicles: list[str]
    next_after: int | None = Field(description="Give it as `after` for the next page; null: this is the last")


class RefusedRuling(View):
    """A sounding that was left as it was."""

    id: int
    reason: str


class RulingsView(View):
    """What came of an operator's word on many soundings; the map is that of the new choice."""

    changed: list[int] = Field(description="Ids of those that are otherwise now")
    unchanged: int = Field(description="How many were so already")
    refused: list[RefusedRuling] = Field(description="Those that cannot be so, with the reason")


class ItemVerdict(View):
    """The verdict on one item of a batch."""

    index: int
    verdict: Verdict
    reason: str = ""


class BatchVerdict(View):
    """The verdicts on a batch, in its order. Whatever is counted accepted is stored for good."""

    accepted: int
    rejected: int
    duplicate: int
    items: list[ItemVerdict]
    replayed: bool = Field(
        default=False, description="True: this idempotency key was seen before, this is the first answer"
    )


class MeasuredCastView(View):
    """A sound speed cast that a vehicle measured on its way; beyond its depths nothing is known."""

    time: datetime = Field(description="The middle of the time in which it was measured, by the vehicle's clock")
    position: tuple[Longitude, Latitude] = Field(description="The middle of where, [longitude, latitude]")
    profile: list[tuple[ProfileDepth, ProfileSpeed]] = Field(
        description="[depth in m, speed in m/s] from top to bottom: means and medians of bins of half a metre, or more"
    )
    sd_mps: float = Field(description="How far single speeds lie from those of their bins, as a standard deviation")
    samples: int = Field(description="Speeds that it is made of")
    bins: list[tuple[int, float]] = Field(
        default=[],
        description="For each entry of the profile [speeds in its bin, how far they lie from their median as a "
        "standard deviation in m/s]; empty: of a log that was read by an earlier version",
    )
    lag_mps: float | None = Field(
        default=None,
        description="By how much speeds on the way down are larger than on the way up, m/s; from 0.5 on, either way, "
        "only the way down counts. Null: too little was measured on both",
    )


class LogImportView(View):
    """What came of a vehicle's log."""

    file: str
    vehicle: str
    soundings: int = Field(description="Accepted, stored for good")
    rejected: int = Field(description="Kept but not used")
    duplicate: int = Field(description="There before, from live telemetry or another log")
    pings: int = Field(default=0, description="Pings of swath sonars that were accepted, stored for good")
    pings_rejected: int = Field(default=0, description="Pings that are kept but not used")
    pings_duplicate: int = Field(default=0, description="Pings that were there before")
    reasons: dict[str, int] = Field(description="Why soundings and pings were rejected, and how many each")
    refused: dict[str, int] = Field(description="Why ranges did not become soundings, and how many each")
    first_s: float | None = Field(description="Vehicle's clock at the first record, Unix seconds")
    last_s: float | None = Field(description="Vehicle's clock at the last record, Unix seconds")
    packets: int
    unreadable: dict[str, int] = Field(description="Packets that could not be read, by reason")
    skipped_bytes: int = Field(description="Bytes that are no packet")
    cut_off: bool = Field(description="The file ends in the middle, as after a power loss; what came before is used")
    notes: list[str] = Field(default=[], description="What was assumed or done, in words")
    casts: list[MeasuredCastView] = Field(
        default=[], description="Sound speed casts that the vehicle measured; none counts before it is added"
    )
    known: bool = Field(description="The whole log had been imported before; nothing was written")


def with_unreadable(unreadable: Mapping[int, str], answer: BatchVerdict) -> BatchVerdict:
    """Return the verdicts on a whole batch, of which ``answer`` judges in order what could be read."""
    if not unreadable:
        return answer
    places = (i for i in range(len(unreadable) + len(answer.items)) if i not in unreadable)
    items = [
        *(ItemVerdict(index=i, verdict=Verdict.REJECTED, reason=reason) for i, reason in unreadable.items()),
        *(verdict.model_copy(update={"index": i}) for i, verdict in zip(places, answer.items, strict=True)),
    ]
    return answer.model_copy(
        update={
            "rejected": answer.rejected + len(unreadable),
            "items": sorted(items, key=lambda verdict: verdict.index),
        }
    )


def batch_verdict(items: list[ItemVerdict]) -> BatchVerdict:
    """Return the verdicts on a batch, in its order, with how many there are of each."""
    tally = {verdict: sum(item.verdict is verdict for item in items) for verdict in Verdict}
    return BatchVerdict(
        accepted=tally[Verdict.ACCEPTED],
        rejected=tally[Verdict.REJECTED],
        duplicate=tally[Verdict.DUPLICATE],
        items=items,
    )
