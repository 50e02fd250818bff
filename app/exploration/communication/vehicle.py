"""A vehicle under limited communication: what it has measured, received, and has yet to report."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.estimation import LandmarkEstimator, Landmarks
from app.exploration.communication.messages import MAX_ENTRIES, STEPS, Entries, MoveOrder, StatusReport, WireFormat
from app.exploration.communication.selection import distance_to_receivers, fill
from app.exploration.communication.shared import Contribution, fuse, news

REMEMBERED = 16
"""Reports of which a vehicle still knows what was in them, should an order answer one of them late."""


class _Report(NamedTuple):
    """What was in a report: landmarks (k,), their information as it was sent, and whether they were told as done."""

    landmarks: IntArray
    information: FloatArray
    done: BoolArray


class VehicleNode:
    """On-board knowledge and the vehicle's half of the exchange (AURO15 sec. 3.4).

    Each step: :meth:`sense`, then :meth:`report` goes out and, when something comes back, :meth:`receive`.

    Reported are the landmarks newly in ``A_j`` (index, estimate, flag) and those seen but not accurate (index, estimate
    so far, flag), at most ``capacity``; the former sorted by distance to vehicles in the reachable exploration area.

    Beyond the paper, what found no room stays queued until the station has confirmed it or it is superseded: by newer
    figures of the same landmark, or by the news that someone else has finished it. The order is: newly accurate ones,
    then unfinished ones out of sight (no look will add to them, and only the station can put them together with what
    others know), then unfinished ones in sight. Finished ones are sorted by distance as in the paper, the others by
    what is known of them: those nearly accurate are what the station most likely presumes accurate by mistake.

    Parameters
    ----------
    number : int
        Of the vehicle, the same as the station knows it by.
    xy_m : (n_landmarks, 2)
        Where the landmarks are.
    estimator : LandmarkEstimator
        Of this vehicle's own sensor.
    wire : WireFormat
        Agreed with the station.
    capacity : int
        Most entries in a message.
    apart_m : float
        Landmarks closer together than this are near-duplicates.
    """

    def __init__(
        self,
        number: int,
        xy_m: FloatArray,
        estimator: LandmarkEstimator,
        wire: WireFormat,
        capacity: int = 10,
        apart_m: float = 0.0,
    ) -> None:
        n = len(xy_m)
        self.number = number
        self.own = Landmarks.unknown(xy_m)
        self.waypoint: FloatArray | None = None
        self._estimator, self._wire = estimator, wire
        self._capacity, self._apart_m = min(capacity, MAX_ENTRIES), apart_m
        self._told = Contribution.nothing(n)
        self._done = np.zeros(n, dtype=np.bool_)
        self._settled = np.zeros(n, dtype=np.bool_)
        self._confirmed = np.zeros(n)
        self._in_sight = np.zeros(n, dtype=np.bool_)
        self._receivers: FloatArray = np.zeros((0, 3))
        self._reports: dict[int, _Report] = {}
        self._reported: int | None = None
        self._newest: int | None = None
        self._heard = False

    @property
    def accurate(self) -> BoolArray:
        """``A`` as this vehicle knows it, (n,): from its own looks with received estimates, or received as done."""
        return self._done

    @property
    def knowledge(self) -> Landmarks:
        """What the vehicle knows: its own looks put together with what the others have found out."""
        depth, information = self._fused()
        with np.errstate(divide="ignore"):
            return replace(self.own, depth_m=depth, variance_m2=1.0 / information, accurate=self._done)

    def sense(self, position: FloatArray, index: IntArray, ranges: FloatArray) -> None:
        """Take in this vehicle's own ranges (k,) to landmarks ``index`` (k,) from ``position`` (3,)."""
        self.own = self._estimator.update(self.own, self.number, position, index, ranges)
        self._in_sight[:] = False
        self._in_sight[index] = True
        self._finish()

    def report(self, step: int, position: FloatArray) -> bytes:
        """Return the message to the station after the looks of this step."""
        sent = self._choose(position)
        entries = Entries(sent, self.own.depth_m[sent], np.sqrt(self.own.variance_m2[sent]), self._done[sent])
        self._reported = step % STEPS
        self._reports[self._reported] = _Report(sent, 1.0 / self.own.variance_m2[sent], entries.accurate)
        while len(self._reports) > REMEMBERED:
            del self._reports[next(iter(self._reports))]
        acknowledges, self._heard = self._heard, False
        return self._wire.encode_report(StatusReport(self._reported, self.number, position, acknowledges, entries))

    def receive(self, message: bytes) -> MoveOrder:
        """Take in an order of the station, and return it; one that answers an earlier report changes nothing.

        An order names the last report that reached the station: what was in that one is confirmed, and nothing else.
        Orders that name the same one follow each other as they arrive.
        Only the answer to the last report is acknowledged in the next one; what came in another is sent again.
        """
        order = self._wire.decode_order(message)
        if order.vehicle != self.number:
            raise ValueError(f"order: meant for vehicle {order.vehicle}, received by {self.number}")
        if self._newest is not None and (order.step - self._newest) % STEPS >= STEPS // 2:
            return order
        self._newest = order.step
        self._heard |= order.acknowledges and order.step == self._reported
        self.waypoint = order.waypoint
        self._receivers = order.neighbour_positions
        self._confirm(order.step)
        self._told.take(order.entries)
        finished = order.entries.index[order.entries.accurate]
        self._done[finished] = True
        self._settled[finished] = True  # the station knows already
        self._finish()
        return order

    def _confirm(self, step: int) -> None:
        """Note that the report of a step has reached the station; earlier ones may be lost."""
        report = self._reports.get(step)
        if report is None:
            return
        self._confirmed[report.landmarks] = report.information
        self._settled[report.landmarks] |= report.done
        while next(iter(self._reports)) != step:
            del self._reports[next(iter(self._reports))]
        del self._reports[step]

    def _fused(self) -> tuple[FloatArray, FloatArray]:
        own = Contribution(np.nan_to_num(self.own.depth_m), 1.0 / self.own.variance_m2)
        return fuse([own, self._told], len(self._done))

    def _finish(self) -> None:
        information = 1.0 / self.own.variance_m2 + self._told.information
        self._done |= self.own.accurate | (information > 1.0 / self._estimator.accuracy_sd_m**2)

    def _choose(self, position: FloatArray) -> IntArray:
        information = 1.0 / self.own.variance_m2
        sendable = self.own.variance_m2 < self._wire.largest_sd_m**2
        finished = self._done & ~self._settled & self.own.seen
        unfinished = ~self._done & news(information, self._confirmed) & sendable
        waiting = np.flatnonzero(finished | unfinished)
        receivers = self._receivers if len(self._receivers) else position[None]
        distance = distance_to_receivers(self.own.xy_m[waiting], receivers[:, :2])
        group = np.where(finished[waiting], 0, np.where(self._in_sight[waiting], 2, 1))
        return fill(
            waiting[np.lexsort((np.where(finished[waiting], distance, -information[waiting]), group))],
            self.own.xy_m,
            self._capacity,
            self._apart_m,
        )
