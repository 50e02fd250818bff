from typing import Any

import imcpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.exploration.communication import Entries, MessageError, MoveOrder, StatusReport, WireFormat

AREA = np.array([[-1.0, -0.75], [1.0, -0.75], [1.0, 0.75], [-1.0, 0.75]])
WIRE = WireFormat.around(AREA, -1.0, 1.0, accuracy_sd_m=0.02)

coordinates = st.tuples(st.floats(-1.0, 1.0), st.floats(-0.75, 0.75), st.floats(-1.0, 1.0)).map(np.array)


@st.composite
def entries(draw: Any, at_most: int = 20) -> Any:
    k = draw(st.integers(0, at_most))
    numbers = st.lists(st.integers(0, 65535), min_size=k, max_size=k)
    return Entries(
        np.array(draw(numbers), dtype=np.int64),
        np.array(draw(st.lists(st.floats(-1.0, 1.0), min_size=k, max_size=k))),
        np.array(draw(st.lists(st.floats(0.005, 1.1), min_size=k, max_size=k))),
        np.array(draw(st.lists(st.booleans(), min_size=k, max_size=k)), dtype=np.bool_),
    )


reports = st.builds(StatusReport, st.integers(0, 65535), st.integers(0, 255), coordinates, st.booleans(), entries())


@st.composite
def orders(draw: Any) -> Any:
    m = draw(st.integers(0, 15))
    near = draw(st.lists(coordinates, min_size=m, max_size=m))
    numbers = np.array(draw(st.lists(st.integers(0, 255), min_size=m, max_size=m)), dtype=np.int64)
    step, count, place, last = draw(st.tuples(st.integers(0, 65535), st.integers(0, 255), coordinates, st.booleans()))
    return MoveOrder(step, count, place, last, numbers, np.array(near).reshape(m, 3), draw(entries()))


def assert_same(sent: Any, got: Any) -> None:
    np.testing.assert_array_equal(got.index, sent.index)
    np.testing.assert_array_equal(got.accurate, sent.accurate)
    np.testing.assert_allclose(got.depth_m, sent.depth_m, atol=0.501 * WIRE.depth_resolution_m)
    assert (got.sd_m >= sent.sd_m * (1 - 1e-9)).all()
    assert (got.sd_m <= sent.sd_m * 2 ** (1 / 16) * (1 + 1e-9)).all()


def ten_entries() -> Any:
    k = np.arange(10)
    return Entries(k, np.full(10, 0.5), np.full(10, 0.03), k % 2 == 0)


def test_header_and_ten_entries_take_64_bytes() -> None:
    assert len(WIRE.encode_report(StatusReport(1, 2, np.zeros(3), True, ten_entries()))) == 64
    order = MoveOrder(1, 2, np.zeros(3), True, np.array([3]), np.zeros((1, 3)), ten_entries())
    assert len(WIRE.encode_order(order)) == 64 + 10


def test_the_cube_is_resolved_far_below_the_accuracy_threshold() -> None:
    assert WIRE.depth_resolution_m < 4e-5
    assert (WIRE.position_resolution_m < 2e-7).all()


@given(report=reports)
def test_reports_come_out_as_they_went_in(report: Any) -> None:
    message = WIRE.encode_report(report)
    got = WIRE.decode_report(message)
    assert (got.step, got.vehicle, got.acknowledges) == (report.step, report.vehicle, report.acknowledges)
    assert (np.abs(got.position - report.position) <= 0.501 * WIRE.position_resolution_m).all()
    assert_same(report.entries, got.entries)
    assert WIRE.encode_report(got) == message


@given(order=orders())
def test_orders_come_out_as_they_went_in(order: Any) -> None:
    message = WIRE.encode_order(order)
    got = WIRE.decode_order(message)
    assert (got.step, got.vehicle, got.acknowledges) == (order.step, order.vehicle, order.acknowledges)
    assert (np.abs(got.waypoint - order.waypoint) <= 0.501 * WIRE.position_resolution_m).all()
    np.testing.assert_array_equal(got.neighbours, order.neighbours)
    np.testing.assert_allclose(got.neighbour_positions, order.neighbour_positions, atol=2e-7)
    assert_same(order.entries, got.entries)
    assert WIRE.encode_order(got) == message


@given(message=st.binary(max_size=120))
def test_garbage_is_refused_or_read_but_never_crashes(message: imcpy.Message) -> None:
    for decode in (WIRE.decode_report, WIRE.decode_order):
        try:
            read = decode(message)
        except MessageError:
            continue
        assert 14 + 5 * len(read.entries.index) <= len(message), "nothing is read that was not sent"


def test_messages_cut_short_or_of_the_other_direction_are_refused() -> None:
    message = WIRE.encode_report(StatusReport(1, 2, np.zeros(3), True, ten_entries()))
    with pytest.raises(MessageError, match="63 bytes where the header announces 64"):
        WIRE.decode_report(message[:-1])
    with pytest.raises(MessageError, match="13 bytes are fewer"):
        WIRE.decode_report(message[:13])
    with pytest.raises(MessageError, match="version or direction"):
        WIRE.decode_order(message)


def test_what_lies_out_of_range_saturates() -> None:
    far = Entries(np.array([1]), np.array([7.0]), np.array([1e-6]), np.array([True]))
    got = WIRE.decode_report(WIRE.encode_report(StatusReport(1, 2, np.array([9.0, -9.0, 0.0]), False, far)))
    np.testing.assert_allclose(got.position[:2], [1.2, -0.9])
    assert got.entries.depth_m[0] == pytest.approx(1.2)
    assert got.entries.sd_m[0] == pytest.approx(0.005)


def test_a_deviation_too_large_to_send_arrives_as_infinite() -> None:
    sd = np.array([WIRE.largest_sd_m, 1.01 * WIRE.largest_sd_m, np.inf])
    sent = Entries(np.arange(3), np.zeros(3), sd, np.zeros(3, dtype=np.bool_))
    got = WIRE.decode_report(WIRE.encode_report(StatusReport(1, 2, np.zeros(3), False, sent)))
    assert np.isfinite(got.entries.sd_m).tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("vehicle", "index", "count", "named"), [(256, 0, 1, "vehicle"), (0, 65536, 1, "index"), (0, 0, 256, "256 entries")]
)
def test_what_does_not_fit_is_named(vehicle: Any, index: Any, count: int, named: Any) -> None:
    sent = Entries(np.full(count, index), np.zeros(count), np.ones(count), np.zeros(count, dtype=np.bool_))
    with pytest.raises(MessageError, match=named):
        WIRE.encode_report(StatusReport(1, vehicle, np.zeros(3), False, sent))
