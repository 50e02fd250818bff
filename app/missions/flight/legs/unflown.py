"""Legs that were committed and not flown, until the planner is told: it takes what it has planned as flown."""

from collections.abc import Iterator, Sequence

import numpy as np

from app.arrays import FloatArray

Ends = Sequence[FloatArray]
"""Where legs were to end, each (2,): east, north, metres in the mission's frame."""


class UnflownLegs:
    """The unflown legs of one mission's vehicles, by the vehicle's name."""

    def __init__(self) -> None:
        self._of_orders: dict[str, list[FloatArray]] = {}
        self._barred: dict[str, list[FloatArray]] = {}
        self._left_lines: dict[str, tuple[FloatArray, FloatArray]] = {}

    # Legs of an operator's order

    def add_of_order(self, vehicle: str, ends_m: Ends) -> None:
        """Note legs that led where an operator ordered a vehicle."""
        self._of_orders.setdefault(vehicle, []).extend(ends_m)

    def forget_order(self, vehicle: str) -> None:
        """Drop a vehicle's legs of its order: the planner plans these anew, or no longer."""
        self._of_orders.pop(vehicle, None)

    def has_of_order(self, vehicle: str) -> bool:
        """Whether a vehicle has unflown legs of its order that the planner does not know of."""
        return vehicle in self._of_orders

    def take_of_orders(self) -> Iterator[tuple[str, FloatArray]]:
        """Yield vehicles and the ends (k, 2) of their orders' legs, which are kept no longer."""
        for vehicle in list(self._of_orders):
            yield vehicle, _stacked(self._of_orders.pop(vehicle))

    # Legs that something bars

    def add_barred(self, vehicle: str, ends_m: Ends) -> None:
        """Note legs that something bars from where their vehicle is: it has to be led round."""
        self._barred.setdefault(vehicle, []).extend(ends_m)

    def is_barred(self, vehicle: str) -> bool:
        """Whether a vehicle has barred legs that the planner does not know of."""
        return vehicle in self._barred

    def is_barred_end(self, vehicle: str, end_m: FloatArray) -> bool:
        """Whether a barred leg of a vehicle was to end there, (2,)."""
        return any(np.array_equal(end, end_m) for end in self._barred.get(vehicle, ()))

    def take_barred(self) -> Iterator[tuple[str, FloatArray]]:
        """Yield vehicles and the ends (k, 2) of their barred legs, which are kept no longer."""
        for vehicle in list(self._barred):
            yield vehicle, _stacked(self._barred.pop(vehicle))

    # Lines that vehicles left

    def add_left_line(self, vehicle: str, place_m: FloatArray, ends_m: Ends) -> None:
        """Note where a vehicle that surveys no more left its line, (2,), and the legs that it had.

        Of one that comes back and leaves again before the planner is told, the place counts where it first left.
        """
        place_m, before_m = self._left_lines.get(vehicle, (place_m, _stacked([])))
        self._left_lines[vehicle] = place_m, np.vstack([before_m, _stacked(ends_m)])

    @property
    def any_left_line(self) -> bool:
        """Whether vehicles left lines that the planner does not know of."""
        return bool(self._left_lines)

    def take_left_lines(self) -> Iterator[tuple[str, FloatArray, FloatArray]]:
        """Yield vehicles, where each left its line (2,) and the ends (k, 2) of its legs, which are kept no longer."""
        for vehicle in list(self._left_lines):
            yield vehicle, *self._left_lines.pop(vehicle)

    def waits(self, vehicle: str) -> bool:
        """Whether the planner is to be told of legs of an order, or of barred ones."""
        return vehicle in self._of_orders or vehicle in self._barred


def _stacked(ends_m: Ends) -> FloatArray:
    return np.array(ends_m).reshape(-1, 2)
