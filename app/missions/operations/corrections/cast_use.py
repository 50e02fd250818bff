"""What each sound speed cast of a mission corrects, how far away it was, and how much neighbouring casts differ."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np

from app.arrays import FloatArray, IntArray
from app.mapping.s44 import Order, max_tvu_m
from app.mapping.water.casts import Casts, depth_difference_m
from app.missions.live.mission import LiveMission
from app.missions.operations.corrections.uncertainty_budget import travel_depth_m
from app.missions.soundings.corrections import ASSUMED_MPS, profile_of
from app.missions.spec.swath import SwathSonarSpec
from app.missions.spec.vehicle import Sensor
from app.missions.spec.water import Cast, CastRules, SoundSpeed
from app.missions.views.measurements.corrections import CastChangeView, CastsView, CastView
from app.storage.bulk import read_numbers
from app.storage.concurrency.single_flight import Shared
from app.storage.queries import soundings as sounding_queries

FAR_H = 4.0
"""NOAA's Office of Coast Survey asks for a cast at least every four hours of work with a multibeam (Hydrographic
Surveys Specifications and Deliverables): a ping farther from its cast than that lacks one anyhow."""

PART_OF_TVU = 0.5
"""Neighbouring casts differ much from this part of an order's largest TVU on. Where the water changes evenly from one
to the other, what is left between them is at most half their difference, a quarter of the TVU."""

WIDEST_DEG = 75.0
"""Beams farther to the side are not used."""


class CastUse:
    """Counts for one mission what its casts correct; kept until soundings or corrections change."""

    def __init__(self, live: LiveMission) -> None:
        self._live = live
        self._key: object = None
        self._found = _Used(None, ())
        self._shared = Shared(self._newest)

    async def now(self) -> "_Used":
        """Return what each cast corrects. Raises PingsUnreadableError."""
        return await self._shared()

    async def _newest(self) -> "_Used":
        live = self._live
        await live.journal.flush()
        casts, built = live.gate.corrections.casts, live.builder.newest
        # A ruling changes no count, but there is another map after it.
        key = (casts, live.counts, built and built.version)
        if key != self._key:
            speed = live.spec.sound_speed
            self._found = _Used(speed, () if casts is None else await _counted(live, casts))
            self._key = key
        return self._found


@dataclass(frozen=True)
class _Used:
    """The casts of a mission's description at some time, and what each corrects, in its order."""

    speed: SoundSpeed | None
    tallies: "Sequence[_Tally]"


class _Tally:
    """What one cast corrects."""

    def __init__(self, time_s: float) -> None:
        self._time_s = time_s
        self.soundings = self.pings = self.far_soundings = self.far_pings = 0
        self.first_s, self.last_s, self.farthest_s = np.inf, -np.inf, 0.0

    def add(self, time_s: FloatArray, *, are_pings: bool) -> None:
        """Count what was sounded at some times, (n,)."""
        if not len(time_s):
            return
        self.first_s, self.last_s = min(self.first_s, float(time_s.min())), max(self.last_s, float(time_s.max()))
        away_s = np.abs(time_s - self._time_s)
        far = int((away_s > 3600.0 * FAR_H).sum())  # of a cast without a time none is far
        if np.isfinite(self._time_s):
            self.farthest_s = max(self.farthest_s, float(away_s.max()))
        if are_pings:
            self.pings, self.far_pings = self.pings + len(time_s), self.far_pings + far
        else:
            self.soundings, self.far_soundings = self.soundings + len(time_s), self.far_soundings + far

    def view(self, cast: Cast) -> CastView:
        """Return it as it is shown."""
        none = self.first_s > self.last_s
        return CastView(
            name=cast.name,
            source=cast.source,
            time=cast.time,
            position=cast.position,
            profile=cast.profile,
            soundings=self.soundings,
            pings=self.pings,
            first=None if none else datetime.fromtimestamp(self.first_s, UTC),
            last=None if none else datetime.fromtimestamp(self.last_s, UTC),
            farthest_h=None if none or cast.time is None else self.farthest_s / 3600.0,
        )


async def _counted(live: LiveMission, casts: Casts) -> list[_Tally]:
    """Return what each of some casts corrects of all that was accepted so far."""
    tallies = [_Tally(float(time_s)) for time_s in casts.places.time_s]

    def count(time_s: FloatArray, lat_deg: FloatArray, lon_deg: FloatArray, *, are_pings: bool) -> None:
        try:
            east, north = live.frame.to_local(lat_deg, lon_deg)
        except ValueError:
            return  # such pings are placed nowhere
        chosen: IntArray = casts.chosen(time_s, east, north)
        for number in np.unique(chosen).tolist():
            tallies[number].add(time_s[chosen == number], are_pings=are_pings)

    await read_numbers(
        live.database,
        sounding_queries.cast_query(live.id),
        lambda piece: count(piece[:, 0], piece[:, 1], piece[:, 2], are_pings=False),
    )
    if live.counts.pings:
        async for _, pings in live.pings.all_accepted():
            await asyncio.to_thread(count, pings.time_s, pings.lat_deg, pings.lon_deg, are_pings=True)
    return tallies


async def casts_view(live: LiveMission, order: Order) -> CastsView:
    """Return a mission's casts with what each corrects, and how well they fit. Raises PingsUnreadableError."""
    found = await live.part(CastUse).now()
    speed = found.speed
    rules = speed or CastRules()
    used = [] if speed is None else list(zip(speed.casts, found.tallies, strict=True))
    used.sort(key=lambda one: 0.0 if one[0].time is None else one[0].time.timestamp())
    beam = _outer_beam(live)
    limit_m = None if beam is None else PART_OF_TVU * float(max_tvu_m(np.array(beam.bottom_m), order))
    return CastsView(
        assumed_mps=ASSUMED_MPS if speed is None else speed.assumed_mps,
        rule=rules.rule,
        within_h=rules.within_h,
        casts=[tally.view(cast) for cast, tally in used],
        far_h=FAR_H,
        far_soundings=sum(tally.far_soundings for tally in found.tallies),
        far_pings=sum(tally.far_pings for tally in found.tallies),
        order=order,
        angle_deg=_outer_deg(live),
        sonar_m=None if beam is None else beam.sonar_m,
        depth_m=None if beam is None else beam.bottom_m,
        limit_m=limit_m,
        changes=[]
        if speed is None or beam is None or limit_m is None
        else [_change(before, after, speed.assumed_mps, beam, limit_m) for (before, _), (after, _) in pairwise(used)],
    )


@dataclass(frozen=True)
class _Beam:
    """A beam that depths are compared for."""

    sonar_m: float
    bottom_m: float
    angle_rad: float


def _outer_deg(live: LiveMission) -> float:
    """Return how far to the side the outermost beams of a mission point; single beams look straight down."""
    if not live.has_swath_sonars:
        return 0.0
    carried = [member.spec.sonar for member in live.team if member.spec.sensor is Sensor.MULTIBEAM]
    sonars = [sonar or SwathSonarSpec() for sonar in carried] or [SwathSonarSpec()]
    return min(max(sonar.aperture_deg for sonar in sonars) / 2, WIDEST_DEG)


def _outer_beam(live: LiveMission) -> _Beam | None:
    """Return the outer beam to the map's deepest cell; None where there is no map yet."""
    built = live.builder.newest
    if built is None or not np.isfinite(built.map.depth_m).any():
        return None
    bottom_m = float(np.nanmax(built.map.depth_m))
    sonar_m = min(travel_depth_m(live), bottom_m)
    return _Beam(sonar_m, bottom_m, float(np.radians(_outer_deg(live))))


def _change(before: Cast, after: Cast, assumed_mps: float, beam: _Beam, limit_m: float) -> CastChangeView:
    one, other = profile_of(before, assumed_mps), profile_of(after, assumed_mps)
    difference_m = depth_difference_m(one, other, beam.sonar_m, beam.bottom_m, beam.angle_rad)
    return CastChangeView(
        before=before.name, after=after.name, difference_m=difference_m, is_large=difference_m > limit_m
    )
