"""How knowledge comes together in a run: everything at once, or in messages of limited capacity (AURO15 sec. 3.4)."""

from dataclasses import replace

import numpy as np

from app.arrays import FloatArray, IntArray
from app.estimation import Landmarks
from app.evaluation.explore.world import MAX_STEP, World
from app.exploration.communication import StationNode, VehicleNode, WireFormat
from app.exploration.core.problem import Belief

APART = 0.02
"""Landmarks closer together than this are near-duplicates: as close as the accuracy that is asked for."""

SILENT_AFTER = 5
"""Steps without a report after which the planner no longer counts on a vehicle."""


class UnlimitedTeam:
    """Every measurement reaches the planner at once."""

    sent_bytes = 0

    def __init__(self, world: World) -> None:
        self._world = world

    @property
    def landmarks(self) -> Landmarks:
        """What the team knows."""
        return self._world.landmarks

    def sense(self, rng: np.random.Generator) -> None:
        """Let every vehicle measure from where it is."""
        world = self._world
        world.landmarks = world.measure(world.positions, world.landmarks, rng)

    def report(self, step: int) -> tuple[IntArray, FloatArray, Belief]:
        """Return the truth about the vehicles and everything measured."""
        return self._world.team, self._world.positions, self._world.belief

    def order(self, vehicles: IntArray, waypoints: FloatArray) -> FloatArray:
        """Return the waypoints: every vehicle receives them."""
        return waypoints


class LimitedTeam:
    """Vehicles and a station that exchange messages, some of which may be lost.

    A landmark counts as accurate when a vehicle of the team or the station knows it that accurately; what only a lost
    vehicle knew is lost with it. The planner has nothing but what was transmitted. A vehicle that did not receive its
    order stays where it is.

    Parameters
    ----------
    capacity : int
        Most landmark entries in a message, either way.
    loss : float
        Probability that a message is lost.
    rng : numpy.random.Generator
        Decides which.
    """

    def __init__(self, world: World, capacity: int, loss: float, rng: np.random.Generator) -> None:
        limits = world.scenario.constraints
        self._world, self._capacity, self._loss, self._rng = world, capacity, loss, rng
        self._xy = world.truth[:, :2]
        self._wire = WireFormat.around(
            limits.area, limits.min_depth_m, limits.max_depth_m, world.estimator.accuracy_sd_m
        )
        self._station = StationNode(self._xy, world.scenario.sensor, self._wire, MAX_STEP, capacity, APART)
        self._nodes: dict[int, VehicleNode] = {}
        self.sent_bytes = 0

    @property
    def landmarks(self) -> Landmarks:
        """For each landmark the best knowledge of any vehicle or the station; accurate when it is to one."""
        known = [self._node(int(number)).knowledge for number in self._world.team]
        station = replace(
            Landmarks.unknown(self._xy),
            depth_m=self._station.depth_m,
            variance_m2=self._station.known_sd_m**2,
            accurate=self._station.known_accurate,
        )
        known.append(station)
        best = np.argmin([k.variance_m2 for k in known], axis=0)
        rows = np.arange(len(self._xy))
        return replace(
            station,
            depth_m=np.array([k.depth_m for k in known])[best, rows],
            variance_m2=np.array([k.variance_m2 for k in known])[best, rows],
            looks=np.max([k.looks for k in known], axis=0),
            accurate=np.any([k.accurate for k in known], axis=0),
        )

    def sense(self, rng: np.random.Generator) -> None:
        """Let every vehicle measure from where it is."""
        world = self._world
        for number, position, seen in zip(world.team, world.positions, world.visible(world.positions), strict=True):
            index = np.flatnonzero(seen)
            self._node(int(number)).sense(
                position, index, world.scenario.sensor.measure(position, world.truth[index], rng)
            )

    def report(self, step: int) -> tuple[IntArray, FloatArray, Belief]:
        """Let every vehicle report; return what the station makes of it."""
        self._station.begin()
        for number, position in zip(self._world.team, self._world.positions, strict=True):
            message = self._node(int(number)).report(step, position)
            if self._arrives(message):
                self._station.receive(message)
        self._station.conclude()
        vehicles = np.array(self._station.heard_within(SILENT_AFTER), dtype=np.int64)
        positions = np.array([self._station.position(k) for k in vehicles]).reshape(-1, 3)
        known = replace(
            self._world.belief,
            depth_m=self._station.depth_m,
            sd_m=self._station.sd_m,
            accurate=self._station.accurate,
            complete=False,
        )
        return vehicles, positions, known

    def order(self, vehicles: IntArray, waypoints: FloatArray) -> FloatArray:
        """Send the station's orders; return where the vehicles go that are there, no farther than a step."""
        goals = self._world.positions.copy()
        for number, waypoint in zip(vehicles, waypoints, strict=True):
            message = self._station.order(int(number), waypoint)
            row = np.flatnonzero(self._world.team == number)
            if self._arrives(message) and len(row):
                leg = self._node(int(number)).receive(message).waypoint - goals[row[0]]
                goals[row[0]] += leg * min(1.0, MAX_STEP / max(float(np.linalg.norm(leg)), 1e-12))
        return goals

    def _arrives(self, message: bytes) -> bool:
        self.sent_bytes += len(message)
        return bool(self._rng.random() >= self._loss)

    def _node(self, number: int) -> VehicleNode:
        if number not in self._nodes:
            self._nodes[number] = VehicleNode(
                number, self._xy, self._world.estimator, self._wire, self._capacity, APART
            )
        return self._nodes[number]
