"""How the errors of reckoned positions grow, as rows of a sparse least-squares problem over nodes of the tracks."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from app.arrays import ComplexArray, FloatArray, IntArray
from app.estimation.adjustment.tracks import Fixes, TrackSoundings

HOUR_S = 3600.0
PLACE_S = 5.0
"""A vehicle is amid what it sounds within so many seconds."""

SILENT_S = 1800.0
"""Over a time in which nothing was sounded or fixed for longer, one step leads from its begin to its end."""

FACTORS = (0.25, 0.35, 0.5, 0.71, 1.0, 1.41, 2.0, 2.83, 4.0)
FACTOR_LOG_SD = 1.0
"""Vehicles drift more or less than usual by a factor whose logarithm has this deviation."""

LEAST = {
    "walk_m": 1e-3,
    "rate_mph": 1e-3,
    "rate_time_s": 1e-3,
    "start_sd_m": 1e-3,
    "scale_sd": 1e-6,
    "heading_sd_rad": 1e-6,
}
"""What is less stands for none: a millimetre, in an hour or on a way of a kilometre."""

LEAST_FIX_M = 1e-3
"""The same of a fix."""

RATE_TIMES_S = (200.0, 500.0, 1200.0)
"""So long currents and headings last, about; each is as probable."""


@dataclass(frozen=True)
class DriftModel:
    """How a vehicle's reckoned position drifts from where it is; the same for east and north.

    The error is the sum of a random walk, of a rate that changes slowly (a Gauss-Markov process of first order), as
    currents make it, and of a share of the way since the dive began, as a wrong heading (across) and a wrong scale of
    speed (along) make it: it grows on each line, and goes back on the next.

    Attributes
    ----------
    walk_m
        Standard deviation of the random walk after an hour.
    rate_mph
        Standard deviation of the rate, metres an hour.
    rate_time_s
        After so long the rate is mostly another one.
    start_sd_m
        Standard deviation of the error at the begin of a dive.
    scale_sd
        Standard deviation of the share of the way that it is off by along it; Doppler logs have 0.2 to 0.4 % of it.
    heading_sd_rad
        The same across, by a wrong heading; compasses on vehicles are off by 0.5 to 1 degree.
    """

    walk_m: float = 3.0
    rate_mph: float = 15.0
    rate_time_s: float = 600.0
    start_sd_m: float = 1.0
    scale_sd: float = 0.003
    heading_sd_rad: float = 0.01

    def usable(self) -> "DriftModel":
        """Return the same with errors that are not there (0) as small as can be reckoned with.

        Raises
        ------
        ValueError
            For one that is negative or no number.
        """
        for name in LEAST:
            value = getattr(self, name)
            if not 0.0 <= value < np.inf:
                raise ValueError(f"{name}: {value} is no standard deviation or time; 0 or more is, 0 for none")
        return DriftModel(**{name: max(getattr(self, name), least) for name, least in LEAST.items()})

    def variants(self) -> list[tuple["DriftModel", float]]:
        """Return the models that may hold where this is what is usual, each with the logarithm of its probability.

        They drift by other factors and keep their rates for other times; all less one constant.
        """
        return [
            (
                replace(self, walk_m=factor * self.walk_m, rate_mph=factor * self.rate_mph, rate_time_s=time_s),
                -0.5 * (np.log(factor) / FACTOR_LOG_SD) ** 2,
            )
            for factor in FACTORS
            for time_s in RATE_TIMES_S
        ]


@dataclass(frozen=True)
class DriftNodes:
    """Nodes of all tracks, m of them; errors between two of a dive are linear in time.

    Attributes
    ----------
    vehicle, dive : (m,)
        Dives are numbered over all vehicles; a fix that the vehicle reckons from begins another one.
    time_s : (m,)
    place_m : (m, 2)
        East and north by the vehicle's own position, about.
    """

    vehicle: IntArray
    dive: IntArray
    time_s: FloatArray
    place_m: FloatArray

    def __len__(self) -> int:
        return len(self.time_s)

    @classmethod
    def along(cls, soundings: TrackSoundings, fixes: Fixes, spacing_s: float) -> "DriftNodes":
        """Return nodes about so many seconds apart, from the first sounding or fix of each dive to its last.

        None lies within a time that was silent for longer than :data:`SILENT_S`, years by a clock that was wrong.
        """
        vehicle: list[int] = []
        dives: list[FloatArray] = []
        for one in np.unique(soundings.vehicle).tolist():
            at = soundings.time_s[soundings.vehicle == one]
            of_fixes = fixes.time_s[fixes.vehicle == one]
            cuts = np.unique(fixes.time_s[(fixes.vehicle == one) & fixes.resets])
            low, high = min(at.min(), of_fixes.min(initial=np.inf)), max(at.max(), of_fixes.max(initial=-np.inf))
            cuts = cuts[(cuts > low) & (cuts < high)]
            heard = np.unique(np.concatenate([at, of_fixes]))
            for begin, end in zip([low, *cuts], [*cuts, high], strict=True):
                vehicle.append(one)
                dives.append(_node_times(begin, end, heard[(heard > begin) & (heard < end)], spacing_s))
        sizes = [len(times) for times in dives]
        places = [_places(soundings, one, times) for one, times in zip(vehicle, dives, strict=True)]
        return cls(
            vehicle=np.repeat(np.array(vehicle, dtype=np.int64), sizes),
            dive=np.repeat(np.arange(len(dives)), sizes),
            time_s=np.concatenate([np.zeros(0), *dives]),
            place_m=np.concatenate([np.zeros((0, 2)), *places]),
        )

    def weights(self, vehicle: IntArray, time_s: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return which two nodes an error at some times (n,) lies between, (n, 2), and the share of each, (n, 2).

        Before the first and after the last node it is that node's. At the end of a dive it is still of this dive.
        """
        rows = np.zeros((len(time_s), 2), dtype=np.int64)
        share = np.zeros((len(time_s), 2))
        share[:, 0] = 1.0
        for one in np.unique(vehicle).tolist():
            mine = np.flatnonzero(vehicle == one)
            own = np.flatnonzero(self.vehicle == one)
            if not len(own):
                continue
            at = self.time_s[own]
            after = np.clip(np.searchsorted(at, time_s[mine], side="left"), 1, max(len(own) - 1, 1))
            after = np.minimum(after, len(own) - 1)
            before = np.maximum(after - 1, 0)
            span = at[after] - at[before]
            part = np.clip((time_s[mine] - at[before]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)
            part = np.where(span > 0.0, part, 1.0)
            rows[mine] = np.column_stack([own[before], own[after]])
            share[mine] = np.column_stack([1.0 - part, part])
        return rows, share

    def interpolation(self, vehicle: IntArray, time_s: FloatArray) -> sparse.csr_array:
        """Return the matrix (n, m) that makes errors at some times of the nodes' errors."""
        rows, share = self.weights(vehicle, time_s)
        at = np.repeat(np.arange(len(time_s)), 2)
        return sparse.csr_array((share.ravel(), (at, rows.ravel())), shape=(len(time_s), len(self)))


def _node_times(begin: float, end: float, heard: FloatArray, spacing_s: float) -> FloatArray:
    """Return the times of a dive's nodes; between ``begin`` and ``end`` something was heard at times ``heard`` (n,)."""
    times = np.concatenate([[begin], heard, [end]])
    breaks = np.flatnonzero(np.diff(times) > SILENT_S)
    pieces = []
    for first, last in zip(times[np.append(0, breaks + 1)], times[np.append(breaks, len(times) - 1)], strict=True):
        alone = last == first and len(breaks) > 0
        count = 0 if alone else max(1, round((last - first) / spacing_s))
        pieces.append(np.linspace(first, last, count + 1))
    return np.concatenate(pieces)


def _places(soundings: TrackSoundings, vehicle: int, time_s: FloatArray) -> FloatArray:
    """Return where a vehicle was at the nodes of a dive (n,), (n, 2): amid what it sounded then, else between that."""
    begin = time_s[0]
    own = soundings.take(
        (soundings.vehicle == vehicle) & (soundings.time_s >= begin) & (soundings.time_s <= time_s[-1])
    )
    if not len(own):
        return np.zeros((len(time_s), 2))
    _, piece = np.unique(np.floor((own.time_s - begin) / PLACE_S), return_inverse=True)
    count = np.bincount(piece)
    at, east, north = (np.bincount(piece, column) / count for column in (own.time_s - begin, own.east_m, own.north_m))
    return np.column_stack([np.interp(time_s - begin, at, east), np.interp(time_s - begin, at, north)])


def prior_rows(nodes: DriftNodes, fixes: Fixes, model: DriftModel) -> tuple[sparse.csr_array, ComplexArray]:
    """Return what drift and fixes say of errors and rates, whose real part is east and imaginary one north.

    Returns
    -------
    A matrix (r, u) of weighted rows, of errors of all m nodes first, then of their rates (m/s), then of the share of
    its way that each dive is off by (real along, imaginary across to port), of which alone they say nothing; and what
    it is to be multiplied to, (r,).
    """
    m = len(nodes)
    rate_sd = model.rate_mph / HOUR_S
    rows: list[IntArray] = []
    cols: list[IntArray] = []
    values: list[ComplexArray] = []
    right: list[ComplexArray] = []
    count = 0

    def add(entries: list[tuple[IntArray, Any]], sd: FloatArray, to: complex = 0.0) -> None:
        nonlocal count
        n = len(sd)
        for column, value in entries:
            rows.append(count + np.arange(n))
            cols.append(column)
            values.append(np.asarray(value / sd, dtype=np.complex128))
        right.append(np.asarray(to / sd, dtype=np.complex128))
        count += n

    joined = np.flatnonzero(np.diff(nodes.dive) == 0)
    step = nodes.time_s[joined + 1] - nodes.time_s[joined]
    one = np.ones(len(joined))
    way = np.diff(nodes.place_m @ (1.0, 1.0j))[joined]
    walk_sd = np.maximum(model.walk_m * np.sqrt(step / HOUR_S), 1e-3)
    # What a Gauss-Markov rate adds up to, given its values at both ends, however long the step is.
    time_s = model.rate_time_s
    of_ends = time_s * np.tanh(0.5 * step / time_s)
    drifted_sd = rate_sd * np.sqrt(2.0 * time_s * np.maximum(step - 2.0 * of_ends, 0.0))
    add(
        [
            (joined + 1, one),
            (joined, -one),
            (m + joined, -of_ends),
            (m + joined + 1, -of_ends),
            (2 * m + nodes.dive[joined], -way),
        ],
        np.hypot(walk_sd, drifted_sd),
    )
    kept = np.exp(-step / model.rate_time_s)
    add([(m + joined + 1, one), (m + joined, -kept)], rate_sd * np.sqrt(np.maximum(1.0 - kept**2, 1e-6)))
    first = np.flatnonzero(np.diff(nodes.dive, prepend=-1) != 0)
    start = np.ones(len(first))
    add([(m + first, start)], rate_sd * start)
    start_sd = model.start_sd_m * start
    for k in range(len(fixes)):
        # A dive that begins at a fix is as well known as that.
        begins = (nodes.vehicle[first] == fixes.vehicle[k]) & (np.abs(nodes.time_s[first] - fixes.time_s[k]) < 1e-6)
        if fixes.resets[k]:
            start_sd[begins] = fixes.sd_m[k]
    add([(first, start)], start_sd)
    last = np.append(first[1:], m) - 1
    for k in range(len(fixes)):
        mine = nodes.vehicle == fixes.vehicle[k]
        if not mine.any():
            continue
        ends = last[(nodes.vehicle[last] == fixes.vehicle[k]) & (np.abs(nodes.time_s[last] - fixes.time_s[k]) < 1e-6)]
        begins_here = (first[nodes.vehicle[first] == fixes.vehicle[k]]).min()
        if fixes.resets[k] and not len(ends) and fixes.time_s[k] <= nodes.time_s[begins_here]:
            continue  # nothing was reckoned before it
        at, share = nodes.weights(fixes.vehicle[k : k + 1], fixes.time_s[k : k + 1])
        if len(ends):
            at, share = np.array([[ends[0], ends[0]]]), np.array([[1.0, 0.0]])
        off = complex(fixes.east_m[k], fixes.north_m[k])
        add([(at[:, 0], share[:, 0]), (at[:, 1], share[:, 1])], fixes.sd_m[k : k + 1], off)
    matrix = sparse.csr_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))), shape=(count, 2 * m + len(first))
    )
    return matrix, np.concatenate(right)
