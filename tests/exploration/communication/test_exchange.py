"""Vehicles and station together, over links that lose messages."""

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.estimation import LandmarkEstimator, Landmarks, RangeSensor
from app.exploration.communication import StationNode, VehicleNode, WireFormat

SENSOR = RangeSensor(0.4, 0.1)
ESTIMATOR = LandmarkEstimator(SENSOR)
AREA = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
WIRE = WireFormat.around(AREA, -1.0, 1.0)
STEP = 0.05


class Fleet:
    """A small team over 60 landmarks; ``central`` is what one would know if everything were transmitted."""

    def __init__(self, seed: int, vehicles: int = 3, capacity: int = 10, n: int = 60) -> None:
        self.rng = np.random.default_rng(seed)
        self.truth = np.column_stack([self.rng.uniform(-0.4, 0.4, (n, 2)), self.rng.uniform(0.5, 0.6, n)])
        self.xy = self.truth[:, :2]
        self.capacity = capacity
        self.vehicles = [self.new_vehicle(k) for k in range(vehicles)]
        self.station = StationNode(self.xy, SENSOR, WIRE, STEP, capacity)
        self.positions = {k: self.place() for k in range(vehicles)}
        self.central = Landmarks.unknown(self.xy)
        self.step = 0

    def new_vehicle(self, number: Any) -> Any:
        return VehicleNode(number, self.xy, ESTIMATOR, WIRE, self.capacity)

    def place(self) -> Any:
        return np.array([*self.rng.uniform(-0.3, 0.3, 2), 0.3])

    def sense(self) -> None:
        for vehicle in self.vehicles:
            position = self.positions[vehicle.number]
            index = np.flatnonzero(SENSOR.visible(position[None], self.truth)[0])
            ranges = SENSOR.measure(position, self.truth[index], self.rng)
            vehicle.sense(position, index, ranges)
            self.central = ESTIMATOR.update(self.central, vehicle.number, position, index, ranges)

    def exchange(self, lost: Any = lambda: False, silent: Collection[int] = ()) -> Any:
        """One step of messages; returns the orders that arrived, by vehicle."""
        self.step += 1
        self.station.begin()
        for vehicle in self.vehicles:
            message = vehicle.report(self.step, self.positions[vehicle.number])
            if vehicle.number not in silent and not lost():
                self.station.receive(message)
        self.station.conclude()
        arrived = {}
        for vehicle in self.vehicles:
            if vehicle.number not in self.station.members:
                continue
            message = self.station.order(vehicle.number, self.positions[vehicle.number])
            if vehicle.number not in silent and not lost():
                arrived[vehicle.number] = vehicle.receive(message)
        return arrived

    def move(self) -> None:
        self.positions = {k: self.place() for k in self.positions}


def test_with_room_enough_everybody_knows_what_a_central_filter_would() -> None:
    fleet = Fleet(0, capacity=255)
    for _ in range(8):
        fleet.move()
        fleet.sense()
        fleet.exchange()
    fleet.exchange()
    seen = fleet.central.seen & ~fleet.station.known_accurate  # nobody goes on about what is done
    central_sd = np.sqrt(fleet.central.variance_m2[seen])
    assert seen.sum() > 10
    # Deviations are rounded up and small news is not told; each vehicle makes the best of its own ranges.
    for sd in (fleet.station.known_sd_m[seen], np.sqrt(fleet.vehicles[0].knowledge.variance_m2[seen])):
        assert np.median(sd / central_sd) == pytest.approx(1.03, abs=0.05)
        assert (sd < 1.3 * central_sd).all()
    apart = (fleet.station.depth_m[seen] - fleet.central.depth_m[seen]) / central_sd
    assert np.sqrt(np.mean(apart**2)) < 0.5


@given(seed=st.integers(0, 1000), capacity=st.integers(1, 12), loss=st.floats(0.0, 0.6))
@settings(max_examples=20, deadline=None)
def test_nobody_ever_claims_to_know_more_than_was_measured(seed: int, capacity: int, loss: float) -> None:
    fleet = Fleet(seed, capacity=capacity)
    radio = np.random.default_rng(seed)
    known = fleet.station.known_accurate.copy()
    most = np.zeros((len(fleet.vehicles), len(fleet.xy)))  # a look may make a vehicle less sure of what it told
    for _ in range(6):
        fleet.move()
        fleet.sense()
        orders = fleet.exchange(lambda: radio.random() < loss)
        most = np.maximum(most, [1.0 / v.own.variance_m2 for v in fleet.vehicles])
        own = most.sum(axis=0)
        assert (1.0 / fleet.station.known_sd_m**2 <= own * (1 + 1e-9)).all()
        for vehicle in fleet.vehicles:
            assert (1.0 / vehicle.knowledge.variance_m2 <= own * (1 + 1e-9)).all()
        proven = (own > 1.0 / ESTIMATOR.accuracy_sd_m**2) | np.any([v.own.accurate for v in fleet.vehicles], axis=0)
        assert not (fleet.station.known_accurate & ~proven).any()
        assert not (known & ~fleet.station.known_accurate).any()
        assert all(len(order.entries) <= capacity for order in orders.values())
        known = fleet.station.known_accurate.copy()


@given(seed=st.integers(0, 1000), loss=st.floats(0.0, 0.7))
@settings(max_examples=10, deadline=None)
def test_lost_messages_delay_but_nothing_is_lost_for_good(seed: int, loss: float) -> None:
    fleet = Fleet(seed, capacity=5)
    radio = np.random.default_rng(seed)
    for _ in range(10):
        fleet.move()
        fleet.sense()
        fleet.exchange(lambda: radio.random() < loss)
    for _ in range(40):
        fleet.exchange(lambda: radio.random() < loss)
    for _ in range(40):
        fleet.exchange()
    everyone = np.any([v.own.accurate for v in fleet.vehicles], axis=0)
    assert (fleet.station.known_accurate | ~everyone).all()
    for vehicle in fleet.vehicles:
        assert (vehicle.accurate | ~everyone).all()
        assert len(WIRE.decode_report(vehicle.report(200, fleet.positions[vehicle.number])).entries) == 0


def test_a_silent_vehicle_holds_up_nobody_and_tells_all_when_it_is_back() -> None:
    fleet = Fleet(2)
    fleet.sense()
    fleet.exchange()
    where = fleet.station.position(1).copy()
    for _ in range(10):
        fleet.move()
        fleet.sense()
        orders = fleet.exchange(silent={1})
        assert set(orders) == {0, 2}
    np.testing.assert_allclose(fleet.station.position(1), where, atol=1e-6)
    untold = fleet.vehicles[1].own.accurate & ~fleet.station.known_accurate
    for _ in range(10):
        orders = fleet.exchange()
    assert set(orders) == {0, 1, 2}
    np.testing.assert_allclose(fleet.station.position(1), fleet.positions[1], atol=1e-6)
    assert fleet.station.known_accurate[untold].all()


def test_a_vehicle_that_is_not_heard_once_is_presumed_to_have_followed_its_order() -> None:
    fleet = Fleet(2, vehicles=1)
    fleet.sense()
    fleet.exchange()
    goal = fleet.positions[0] + np.array([0.03, 0.0, 0.0])
    fleet.station.order(0, goal)
    for _ in range(3):  # once is enough: what it did after that, nobody knows
        fleet.station.begin()
        fleet.station.conclude()
        np.testing.assert_array_equal(fleet.station.position(0), goal)
        fleet.station.order(0, goal + 1.0)


def test_a_vehicle_joins_on_the_fly_and_learns_what_the_others_know() -> None:
    fleet = Fleet(3, vehicles=2)
    for _ in range(10):
        fleet.move()
        fleet.sense()
        fleet.exchange()
    fleet.positions[7] = np.array([0.0, 0.0, 0.3])
    fleet.vehicles.append(fleet.new_vehicle(7))
    assert 7 not in fleet.station.members
    for _ in range(15):
        fleet.exchange()
    assert fleet.station.members == (0, 1, 7)
    assert fleet.vehicles[-1].accurate.sum() == fleet.station.known_accurate.sum() > 0


def test_reports_that_come_late_or_twice_change_nothing() -> None:
    fleet = Fleet(4, vehicles=1)
    fleet.sense()
    old = fleet.vehicles[0].report(1, fleet.positions[0])
    fleet.station.begin()
    fleet.station.receive(old)
    fleet.move()
    fleet.sense()
    new = fleet.vehicles[0].report(2, fleet.positions[0])
    fleet.station.receive(new)
    fleet.station.conclude()
    depth, sd = fleet.station.depth_m.copy(), fleet.station.sd_m.copy()
    for message in (old, new):
        fleet.station.receive(message)
    np.testing.assert_array_equal(fleet.station.position(0), WIRE.decode_report(new).position)
    np.testing.assert_array_equal(fleet.station.depth_m, depth)
    np.testing.assert_array_equal(fleet.station.sd_m, sd)


def test_the_order_in_which_reports_arrive_does_not_matter() -> None:
    first, second = Fleet(5), Fleet(5)
    second.vehicles.reverse()
    for fleet in (first, second):
        for vehicle in sorted(fleet.vehicles, key=lambda v: v.number):
            index = np.arange(20 * vehicle.number, 20 * vehicle.number + 20)
            vehicle.sense(fleet.positions[vehicle.number], index, np.full(20, 0.3))
        fleet.exchange()
    np.testing.assert_allclose(first.station.depth_m, second.station.depth_m, rtol=1e-12)
    np.testing.assert_allclose(first.station.sd_m, second.station.sd_m, rtol=1e-12)


def test_finished_landmarks_go_first_and_then_those_that_are_nearly_finished() -> None:
    fleet = Fleet(6, vehicles=2, capacity=4)
    above = np.argmin(np.hypot(*(fleet.xy - [0.1, 0.0]).T))
    fleet.positions = {0: np.array([0.0, 0.0, 0.3]), 1: np.array([*fleet.xy[above], 0.3])}
    fleet.sense()
    fleet.exchange()
    orders = fleet.exchange()
    assert orders[0].neighbours.tolist() == [1]
    np.testing.assert_allclose(orders[0].neighbour_positions, [fleet.positions[1]], atol=1e-6)
    vehicle = fleet.vehicles[0]
    vehicle._confirmed[:] = 0.0
    done = np.zeros(60, dtype=np.bool_)
    done[np.flatnonzero(vehicle.own.seen)[-2:]] = True
    vehicle._done[:] = done
    sent = WIRE.decode_report(vehicle.report(2, fleet.positions[0])).entries
    assert done[sent.index[:2]].all()
    assert sent.accurate.tolist() == [True, True, False, False]
    open_ = vehicle.own.seen & ~done
    best_known = np.argsort(vehicle.own.variance_m2[open_], kind="stable")
    assert sent.index[2:].tolist() == np.flatnonzero(open_)[best_known[:2]].tolist()


def test_a_vehicle_out_of_reach_is_no_neighbour() -> None:
    fleet = Fleet(6, vehicles=2)
    fleet.positions = {0: np.array([-0.3, 0.0, 0.3]), 1: np.array([0.95, 0.95, 0.3])}
    fleet.sense()
    assert len(fleet.exchange()[0].neighbours) == 0


def test_what_must_have_been_measured_is_presumed_until_told_or_too_long_ago() -> None:
    fleet = Fleet(7, vehicles=1, capacity=2, n=240)
    for k in range(15):
        fleet.positions[0][2] = 0.3 + 0.06 * np.sin(k)  # from one depth alone, nobody knows what lies above it
        fleet.sense()
        fleet.exchange()
    told = fleet.station.known_accurate
    assert (fleet.station.accurate & ~told).any()
    for _ in range(30):  # nothing is heard any more
        fleet.station.begin()
        fleet.station.conclude()
    np.testing.assert_array_equal(fleet.station.accurate, told)


def test_an_order_for_another_vehicle_is_refused() -> None:
    fleet = Fleet(8, vehicles=2)
    fleet.sense()
    fleet.exchange()
    with pytest.raises(ValueError, match="meant for vehicle 1, received by 0"):
        fleet.vehicles[0].receive(fleet.station.order(1, fleet.positions[1]))


def alone(*, capacity: int = 10) -> tuple[Fleet, Any, Any]:
    """One vehicle that has looked often at one half of the landmarks, its report of step 1 arrived; the order to it."""
    fleet = Fleet(9, vehicles=1, capacity=capacity)
    look(fleet, np.arange(30))
    fleet.station.begin()
    fleet.station.receive(fleet.vehicles[0].report(1, fleet.positions[0]))
    fleet.station.conclude()
    return fleet, fleet.vehicles[0], fleet.station.order(0, np.array([0.1, 0.0, 0.3]))


def look(fleet: Fleet, index: Any) -> None:
    """Let the vehicle range to landmarks from many places, without a word."""
    for _ in range(60):
        place = np.array([*fleet.rng.uniform(-0.3, 0.3, 2), fleet.rng.uniform(0.2, 0.4)])
        fleet.vehicles[0].sense(place, index, SENSOR.measure(place, fleet.truth[index], fleet.rng))


def told_in(message: bytes) -> set[int]:
    return set(WIRE.decode_report(message).entries.index.tolist())


def test_a_late_order_does_not_confirm_a_newer_report_that_was_lost() -> None:
    fleet, vehicle, late = alone()
    arrived = set(np.flatnonzero(np.isfinite(fleet.station.known_sd_m)))
    look(fleet, np.arange(30, 60))
    lost = told_in(vehicle.report(2, fleet.positions[0])) - arrived
    assert lost
    vehicle.receive(late)
    for step in range(3, 40):
        fleet.station.begin()
        fleet.station.receive(vehicle.report(step, fleet.positions[0]))
        fleet.station.conclude()
        vehicle.receive(fleet.station.order(0, fleet.positions[0]))
    assert np.isfinite(fleet.station.known_sd_m[sorted(lost)]).all()


def test_a_late_order_confirms_the_report_that_it_answers_as_it_was() -> None:
    fleet, vehicle, late = alone()
    first = set(np.flatnonzero(np.isfinite(fleet.station.known_sd_m)))
    again = told_in(vehicle.report(2, fleet.positions[0]))
    assert again == first  # not confirmed yet
    vehicle.receive(late)
    assert not told_in(vehicle.report(3, fleet.positions[0])) & first
    other, vehicle, late = alone(capacity=1)
    told = np.flatnonzero(np.isfinite(other.station.known_sd_m))
    sent = 1.0 / vehicle.own.variance_m2[told]
    look(other, told)  # what is learned after the report, the station does not know
    vehicle.receive(late)
    np.testing.assert_array_equal(vehicle._confirmed[told], sent)


@pytest.mark.parametrize("step", [5, 65_534])
def test_orders_older_than_the_newest_are_ignored(step: int) -> None:
    """Also where the count of steps begins anew."""
    fleet = Fleet(4, vehicles=1)
    vehicle, goals = fleet.vehicles[0], [np.array([0.1 * k, 0.0, 0.3]) for k in range(4)]
    orders = []
    for k, goal in enumerate(goals):
        fleet.sense()
        fleet.station.begin()
        fleet.station.receive(vehicle.report(step + k, fleet.positions[0]))
        fleet.station.conclude()
        orders.append(fleet.station.order(0, goal))
    for taken, expected in ((1, 1), (0, 1), (3, 3), (2, 3), (3, 3)):
        vehicle.receive(orders[taken])
        np.testing.assert_allclose(vehicle.waypoint, goals[expected], atol=1e-6)


def test_what_came_in_a_late_order_is_not_taken_for_what_came_in_the_last_one() -> None:
    """The vehicle acknowledges nothing but the answer to its last report, so that the station sends the rest again."""
    fleet = Fleet(3, vehicles=2)
    for _ in range(3):
        fleet.move()
        fleet.sense()
        fleet.exchange()
    vehicle = fleet.vehicles[0]
    orders = []
    for _ in range(2):
        fleet.step += 1
        fleet.station.begin()
        for each in fleet.vehicles:
            fleet.station.receive(each.report(fleet.step, fleet.positions[each.number]))
        fleet.station.conclude()
        orders.append(fleet.station.order(0, fleet.positions[0]))
    vehicle.receive(orders[0])
    assert not WIRE.decode_report(vehicle.report(fleet.step + 1, fleet.positions[0])).acknowledges
    fleet.station.order(0, fleet.positions[0])  # nothing heard: no answer to a report
    vehicle.report(fleet.step + 2, fleet.positions[0])
    fleet.exchange()
    assert WIRE.decode_report(vehicle.report(fleet.step + 1, fleet.positions[0])).acknowledges


def test_who_becomes_less_sure_says_so_and_is_believed() -> None:
    """Looks may speak for another depth than those before: the station and the others then know less, too."""
    fleet = Fleet(10, vehicles=2, n=1)
    first, second = fleet.vehicles

    def know(depth: float, sd: float) -> None:
        first.own = replace(first.own, depth_m=np.array([depth]), variance_m2=np.array([sd**2]))
        for _ in range(3):
            fleet.exchange()

    for depth, sd in ((0.6, 0.03), (0.4, 0.09), (0.4, 0.04)):
        know(depth, sd)
        assert fleet.station.depth_m[0] == pytest.approx(depth, abs=1e-3)
        assert fleet.station.known_sd_m[0] == pytest.approx(sd, rel=0.05)
        assert second.knowledge.depth_m[0] == pytest.approx(depth, abs=1e-3)
        assert np.sqrt(second.knowledge.variance_m2[0]) == pytest.approx(sd, rel=0.1)
    know(0.4, 0.0405)
    assert not told_in(first.report(99, fleet.positions[0]))  # no news
