"""By how much the positions of a mission's vehicles were off, as it is stored and applied."""

import zlib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import orjson

from app.arrays import FloatArray
from app.missions.fleet.interface import SoundingReport


@dataclass(frozen=True)
class TrackAdjustment:
    """Offsets of tracks from where the vehicles were, linear between nodes.

    Attributes
    ----------
    nodes
        By vehicle, (m, 3): its clock (s), and how far east and north (m) its reckoned position was of its true one.
    found
        What is shown of it, as JSON.
    """

    nodes: Mapping[str, FloatArray]
    found: Mapping[str, Any] = field(default_factory=dict)

    def offsets(self, vehicle: str, time_s: FloatArray) -> FloatArray:
        """Return by how much a vehicle's positions were off at some times (n,), (n, 2).

        Nothing before its first node and after its last one: nothing is known of that.
        """
        times = np.asarray(time_s, dtype=float)
        nodes = self.nodes.get(vehicle)
        if nodes is None or not len(nodes):
            return np.zeros((len(times), 2))
        known = (times >= nodes[0, 0]) & (times <= nodes[-1, 0])
        off = np.column_stack([np.interp(times, nodes[:, 0], nodes[:, column]) for column in (1, 2)])
        return np.where(known[:, None], off, 0.0)

    def offsets_of(self, reports: Sequence[SoundingReport]) -> FloatArray:
        """Return by how much soundings (n) were off, (n, 2)."""
        by_vehicle: defaultdict[str, list[int]] = defaultdict(list)
        for row, report in enumerate(reports):
            by_vehicle[report.vehicle].append(row)
        off = np.zeros((len(reports), 2))
        for vehicle, rows in by_vehicle.items():
            off[rows] = self.offsets(vehicle, np.array([reports[row].time_s for row in rows]))
        return off

    def pack(self) -> bytes:
        """Return it as it is stored."""
        nodes = {vehicle: rows.tolist() for vehicle, rows in self.nodes.items()}
        return zlib.compress(orjson.dumps({"nodes": nodes, "found": self.found}))

    @classmethod
    def unpack(cls, stored: bytes) -> "TrackAdjustment":
        """Return what was stored."""
        content = orjson.loads(zlib.decompress(stored))
        nodes = {vehicle: np.array(rows, dtype=float).reshape(-1, 3) for vehicle, rows in content["nodes"].items()}
        return cls(nodes, content["found"])
