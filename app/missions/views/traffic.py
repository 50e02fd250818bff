"""Ships about, as REST, the live feed and the doctor show them."""

from datetime import datetime
from typing import Literal

from pydantic import Field

from app.missions.traffic.own_ship import OLD_S
from app.missions.traffic.ship_list import Ship
from app.missions.traffic.watch import SILENCE_S, Traffic
from app.missions.views.base import View
from imc_bridge.doctor.diagnosis import Severity


class ApproachView(View):
    """The closest point of approach of a ship and the vehicle that it comes closest to."""

    mission_id: str
    vehicle: str
    distance_m: float = Field(description="Between the ship's hull, as far as it is known, and the vehicle")
    in_s: float = Field(description="From now; 0: it is farther every moment")
    alarm: bool = Field(description="Closer than ais.cpa_m within ais.cpa_s")


class ShipView(View):
    """A ship as it was heard last. What it does not tell is null, or an empty text."""

    mmsi: int
    name: str
    call_sign: str
    type: str
    status: str
    own: bool = Field(description="Belongs to the operation: no cause for an alarm")
    lat_deg: float
    lon_deg: float
    sog_mps: float | None = Field(description="Speed over ground")
    cog_deg: float | None = Field(description="Course over ground")
    heading_deg: float | None
    length_m: float | None
    width_m: float | None
    draught_m: float | None
    heard_at: datetime = Field(description="When it was heard, UTC")
    age_s: float = Field(description="Since it was heard")
    closest: ApproachView | None = Field(
        default=None,
        description="To vehicles that are at or near the surface, or will be; null: to none within half an hour",
    )


class TrafficSourceView(View):
    """Where sentences come from."""

    name: str
    open: bool
    reason: str = Field(description="Why nothing can be heard; empty while it is open")
    sentences: int = Field(description="Of AIS, that could be read")
    silent_s: float | None = Field(description="Since the last of them; null: none came yet")


class OwnShipView(View):
    """Where the operation's own ship is, by her GPS or AIS transponder. What she does not tell is null."""

    lat_deg: float
    lon_deg: float
    sog_mps: float | None = Field(description="Speed over ground")
    cog_deg: float | None = Field(description="Course over ground")
    heading_deg: float | None = Field(description="True, of a compass")
    source: str = Field(description="Where that came from")
    heard_at: datetime = Field(description="When it was heard, UTC")
    age_s: float = Field(description="Since it was heard")
    current: bool = Field(description="Heard just now; false: she may be elsewhere")


class TrafficView(View):
    """The ships about and how they are heard."""

    ships: list[ShipView] = Field(description="The nearest to a mission first")
    own_ship: OwnShipView | None = Field(description="null: not heard for ais.max_age_s, or never")
    sources: list[TrafficSourceView] = Field(description="Empty: AIS is not set up, see the settings ais.*")
    malformed: int = Field(description="Sentences that could not be read")
    dropped: int = Field(description="Sentences that came faster than they can be read")
    turned_away: int = Field(description="Positions of ships there was no room for; near ones come before others")
    jumps: int = Field(description="Positions too far from where the ship had just been")


class TrafficMessage(View):
    """The ships near the mission, about once a second where AIS is set up."""

    type: Literal["traffic"] = "traffic"
    time: datetime
    ships: list[ShipView]
    own_ship: OwnShipView | None = None


class TrafficFinding(View):
    """What the doctor says of AIS, and what to do about it."""

    severity: Severity
    text: str
    remedy: str = ""


def ship_view(ship: Ship, traffic: Traffic, closest: ApproachView | None = None) -> ShipView:
    """Return a ship that was heard as it is shown."""
    position, told, own = ship.position, ship.particulars, traffic.settings.own_mmsi
    return ShipView(
        mmsi=position.mmsi,
        name=told.name,
        call_sign=told.call_sign,
        type=told.type,
        status=position.status or "",
        own=position.own or position.mmsi in own,
        lat_deg=position.lat_deg,
        lon_deg=position.lon_deg,
        sog_mps=_rounded(position.sog_mps),
        cog_deg=_rounded(position.cog_deg),
        heading_deg=position.heading_deg,
        length_m=None if told.to_bow_m is None or told.to_stern_m is None else told.to_bow_m + told.to_stern_m,
        width_m=None if told.to_port_m is None or told.to_starboard_m is None else told.to_port_m + told.to_starboard_m,
        draught_m=told.draught_m,
        heard_at=traffic.utc_of(ship.heard_s),
        age_s=round(max(traffic.now_s - ship.heard_s, 0.0), 1),
        closest=closest,
    )


def own_ship_view(traffic: Traffic) -> OwnShipView | None:
    """Return where the own ship is; None where nobody has told that lately."""
    found = traffic.own_ship.at(traffic.now_s)
    if found is None:
        return None
    age_s = max(traffic.now_s - found.heard_s, 0.0)
    return OwnShipView(
        lat_deg=round(found.lat_deg, 8),
        lon_deg=round(found.lon_deg, 8),
        sog_mps=_rounded(found.sog_mps),
        cog_deg=_rounded(found.cog_deg),
        heading_deg=_rounded(found.heading_deg),
        source=found.source,
        heard_at=traffic.utc_of(found.heard_s),
        age_s=round(age_s, 1),
        current=age_s <= OLD_S,
    )


def source_views(traffic: Traffic) -> list[TrafficSourceView]:
    """Return how each source is."""
    return [
        TrafficSourceView(
            name=one.name,
            open=not one.trouble,
            reason=one.trouble,
            sentences=one.sentences,
            silent_s=None if one.silent_s is None else round(one.silent_s, 1),
        )
        for one in traffic.states()
    ]


def traffic_findings(traffic: Traffic) -> list[TrafficFinding]:
    """Return what the doctor says of AIS; nothing where it is not set up."""
    found = []
    for source in traffic.states():
        silent_s = traffic.listened_s if source.silent_s is None else source.silent_s
        if source.trouble:
            text = f"AIS from {source.name} cannot be heard: {source.trouble}"
            remedy = "Check the settings ais.*, and that no other program has the port or the device"
            found.append(TrafficFinding(severity=Severity.PROBLEM, text=text, remedy=remedy))
        elif source.silent_s is None or silent_s >= SILENCE_S:
            text = f"nothing was heard of AIS from {source.name} for {silent_s:.0f} s"
            remedy = "Check the receiver, its aerial and where it sends sentences to; in empty waters it may be so"
            found.append(TrafficFinding(severity=Severity.NOTE, text=text, remedy=remedy))
        else:
            text = f"AIS from {source.name}: {source.sentences} sentences, {len(traffic.ship_list)} ships"
            found.append(TrafficFinding(severity=Severity.OK, text=text))
    if traffic.malformed > sum(source.sentences for source in traffic.states()):
        text = f"{traffic.malformed} sentences of AIS could not be read"
        remedy = "Check the receiver's speed and that nothing else is sent there"
        found.append(TrafficFinding(severity=Severity.PROBLEM, text=text, remedy=remedy))
    return found


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)
