"""A patch test: how a vehicle's sonar is mounted, estimated from its lines that overlap."""

import asyncio
import math
import threading
from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.quality.clock_sessions import set_back_s
from app.mapping.swath.patch_test import (
    ChosenGround,
    Known,
    LineErrors,
    MountingEstimate,
    NoOverlapError,
    Passes,
    PatchBeams,
    SharedGround,
    block_size_m,
    estimate,
    passes_of,
    with_only,
)
from app.mapping.swath.pings import Footprints, Pings
from app.mapping.swath.spikes import states_of
from app.missions.errors import ConflictError
from app.missions.live.mission import LiveMission
from app.missions.operations.corrections.recorrection import check_who_sounded, placed_files
from app.missions.soundings.corrections import Corrections, Placing
from app.missions.spec.mounting import MountingSpec
from app.missions.views.measurements.mounting_estimate import (
    MountingEstimateRequest,
    MountingEstimateView,
    MountingParameter,
    ParameterEstimateView,
    PatchLineView,
)

SEED = 0
"""The same beams are chosen of the same survey."""

LINES_THAT_TELL = {
    MountingParameter.ROLL: "lines flown there and back over the same even ground",
    MountingParameter.PITCH: "a line flown there and back, at one speed, over a slope or over features",
    MountingParameter.HEADING: "lines side by side, overlapping by half, past features or along a slope",
    MountingParameter.LATENCY: "a line flown twice in the same direction over a slope or features, slowly and fast",
}


async def estimate_mounting(live: LiveMission, vehicle: str, request: MountingEstimateRequest) -> MountingEstimateView:
    """Return what the lines of a vehicle say of how its sonar is mounted; nothing is changed.

    Pings are read three times: for the track, for what lines share, and for some of the beams there. Never more than
    these, and some thousand pings, are in memory.

    Raises
    ------
    VehicleNotFoundError
    ConflictError
        When its beams came placed, it has no pings, its clock was set back, or no lines share ground.
    PingsUnreadableError
    """
    await check_who_sounded(live, vehicle)
    files = await placed_files(live, vehicle)
    if files:
        raise ConflictError(
            f"beams from {', '.join(files)} are placed with the mounting that the multibeam was given",
            "evaluate the patch test in the multibeam's own processing",
        )
    # Each holds hundreds of thousands of beams.
    async with live.part(_Turn).taken:
        return await _estimate(live, vehicle, LineErrors(request.position_sd_m, request.level_sd_m))


class _Turn:
    """One patch test of a mission is evaluated at a time."""

    def __init__(self, _live: LiveMission) -> None:
        self.taken = asyncio.Lock()


async def _estimate(live: LiveMission, vehicle: str, errors: LineErrors) -> MountingEstimateView:
    await live.journal.flush()
    until, corrections = await live.pings.newest_block(), live.gate.corrections
    applied = live.spec.mountings.get(vehicle) or live.corrections.stated_mountings.get(vehicle, MountingSpec())
    track = _Track(live)
    async for name, pings in live.pings.all_accepted(until):
        if name == vehicle:
            await live.in_background(track.add, pings)
    survey = await live.in_background(_Survey, track, vehicle, corrections)
    async for name, pings in live.pings.all_accepted(until):
        if name == vehicle:
            await live.in_background(survey.count, pings)
    ground = await live.in_background(survey.choose)
    async for name, pings in live.pings.all_accepted(until):
        if name == vehicle:
            await live.in_background(survey.take, pings, ground)
    left = threading.Event()
    try:
        found = await live.in_background(survey.estimate, errors, left)
    except NoOverlapError as error:
        raise _no_overlap(vehicle, str(error)) from None
    finally:
        # Who asked may have left: a thread does not end by itself.
        left.set()
    return _view(vehicle, applied, survey.passes, found)


def _no_overlap(vehicle: str, why: str) -> ConflictError:
    return ConflictError(
        f"lines of {vehicle} overlap too little: {why}",
        "fly a line there and back, another beside it, and the first once more at another speed, over ground with "
        "slopes or features",
    )


class _Track:
    """Where a vehicle stated to be, and how high above ground its sonar was."""

    def __init__(self, live: LiveMission) -> None:
        self.frame = live.frame
        self._parts: list[FloatArray] = []
        self._heights: list[FloatArray] = []

    def add(self, pings: Pings) -> None:
        try:
            east, north = self.frame.to_local(pings.lat_deg, pings.lon_deg)
        except ValueError:
            # Somewhere far away: nothing of it is in the map, either.
            return
        self._parts.append(np.column_stack([pings.time_s, east, north, pings.heading_rad]))
        down = pings.range_m * np.cos(pings.angle_rad - pings.roll_rad[:, None])
        if np.isfinite(down).any():
            self._heights.append(np.array([np.nanmedian(down)]))

    def sorted(self, vehicle: str) -> FloatArray:
        """Return time, east, north, heading (n, 4) by time. Raises ConflictError."""
        if not self._heights:
            raise ConflictError(
                f"{vehicle} has no pings of a swath sonar", "a patch test needs the beams of a multibeam's lines"
            )
        table = np.concatenate(self._parts)
        back_s = set_back_s(*table[:, :3].T)
        if back_s:
            raise ConflictError(
                f"the clock of {vehicle} was set back by {back_s:.0f} s: two of its ways have the same times",
                "import one of the two ways into a mission of its own, and evaluate the patch test there",
            )
        return np.asarray(table[np.argsort(table[:, 0], kind="stable")])

    @property
    def height_m(self) -> float:
        return float(np.median(np.concatenate(self._heights)))


@dataclass(frozen=True)
class _Met:
    """Where beams (n,) of a vehicle's pings met the bottom as they are placed now, and which of all beams these are."""

    en_m: FloatArray
    line: IntArray
    known: BoolArray


class _Survey:
    """The lines of one vehicle, and beams of ground that they share. For worker threads, one after the other."""

    def __init__(self, track: _Track, vehicle: str, corrections: Corrections) -> None:
        table = track.sorted(vehicle)
        self._vehicle, self._corrections, self._frame = vehicle, corrections, track.frame
        self._time_s, self._en_m = table[:, 0], table[:, 1:3]
        self._height_m = track.height_m
        self.passes = passes_of(self._time_s, self._en_m, table[:, 3])
        self._shared = SharedGround(block_size_m(self._height_m))
        self._rng = np.random.default_rng(SEED)
        self._counting, self._taking = corrections.placing(), corrections.placing()
        self._taken: list[Pings] = []

    def count(self, pings: Pings) -> None:
        """Take in the beams of some pings, to see what lines share."""
        met = self._met(pings, self._counting)
        if met is not None:
            self._shared.add(met.en_m, met.line)

    def choose(self) -> ChosenGround:
        """Return which ground is compared. Raises ConflictError."""
        found = self._shared.chosen(self._rng)
        if found is None:
            raise _no_overlap(self._vehicle, f"{len(self.passes)} straight lines share no ground")
        return found

    def take(self, pings: Pings, ground: ChosenGround) -> None:
        """Keep the beams of some pings that are compared."""
        met = self._met(pings, self._taking)
        if met is None:
            return
        kept = met.known.copy()
        kept[met.known] = ground.takes(met.en_m, met.line, self._rng)
        raw = with_only(self._corrections.steered(self._vehicle, pings), kept)
        if len(raw):
            self._taken.append(raw)

    def estimate(self, errors: LineErrors, left: threading.Event) -> MountingEstimate:
        """Return what the beams say; not once who asked has ``left``. Raises NoOverlapError, NotWantedError."""
        pings = Pings.joined(self._taken)
        beams = PatchBeams(
            pings=pings,
            line=self.passes.of(pings.time_s, pings.heading_rad),
            row=np.searchsorted(self._time_s, pings.time_s),
            shift_m=self._corrections.shift_m(self._vehicle, pings.time_s),
            track_s=self._time_s,
            track_m=self._en_m,
            frame=self._frame,
            casts=self._corrections.casts,
        )
        now = self._corrections.mounting_of(self._vehicle)
        return estimate(beams, now, self._height_m, errors, lambda: not left.is_set())

    def _met(self, pings: Pings, place: Placing) -> _Met | None:
        """Return where beams met the bottom, spikes, rejected ones and what has no line or depth left out."""
        there = place(self._vehicle, pings)
        if there is None:
            return None
        at: Footprints = there.footprints
        line = self.passes.of(pings.time_s, pings.heading_rad)
        detected = np.isfinite(pings.range_m) & np.isfinite(pings.angle_rad)
        good = (line[at.ping] >= 0) & np.isfinite(at.depth_m) & states_of(there).used
        known = detected.copy()
        known[detected] = good
        return _Met(np.column_stack([at.east_m, at.north_m])[good], line[at.ping][good], known)


def _view(vehicle: str, applied: MountingSpec, passes: Passes, found: MountingEstimate) -> MountingEstimateView:
    parameters = [_parameter(name, one, found) for name, one in zip(MountingParameter, found.parameters, strict=True)]
    changes = {one.name.value: one.value for one in parameters if one.proposed}
    proposal = None
    if found.proposal is not None:
        proposal = applied.model_copy(update=changes | {"source": f"patch test of {len(found.lines)} lines"})
    chosen = np.array(found.lines, dtype=np.int64)
    heading_deg = np.degrees(passes.heading_rad) % 360.0
    return MountingEstimateView(
        vehicle=vehicle,
        applied=applied,
        parameters=parameters,
        proposal=proposal,
        before_m=found.agreement.before_m,
        after_m=found.agreement.after_m,
        significance=found.agreement.significance,
        cells=found.cells,
        beams=found.beams,
        lines=[
            PatchLineView(start_s=start, end_s=end, heading_deg=heading, speed_mps=speed)
            for start, end, heading, speed in np.column_stack(
                [passes.start_s, passes.end_s, heading_deg, passes.speed_mps]
            )[chosen].tolist()
        ],
    )


def _parameter(name: MountingParameter, of: str, found: MountingEstimate) -> ParameterEstimateView:
    """Return a parameter in its unit, and why it is proposed, or not."""
    one = found.parameters[of]
    if one.value is None or one.sd is None:
        reasons = {
            Known.UNDETERMINED: "these lines do not tell it",
            Known.UNSETTLED: "these lines do not agree on it",
            Known.BESIDE: "it would be farther from what counts now than is looked for",
        }
        why = f"{reasons[one.known]}; it takes {LINES_THAT_TELL[name]}"
        return ParameterEstimateView(name=name, known=one.known, value=None, sd=None, proposed=False, why=why)
    scale, digits = (1.0, 4) if name is MountingParameter.LATENCY else (math.degrees(1.0), 3)
    agreement = found.agreement
    if one.proposed:
        why = f"with it lines differ by {agreement.after_m:.3f} m RMS instead of {agreement.before_m:.3f} m"
    else:
        why = "it differs too little from what counts now, or lines agree no better with it"
    if name is MountingParameter.PITCH and found.parameters["latency_s"].value is None:
        why += "; it holds for the latency that counts now"
    value, sd = round(scale * one.value, digits), round(scale * one.sd, digits)
    return ParameterEstimateView(name=name, known=one.known, value=value, sd=sd, proposed=one.proposed, why=why)
