"""A demonstration runs as fast as the machine decides."""

import pytest

from app.demo.pace import FASTEST, ROUNDS_PER_S, SLOWEST, kept_speed, speed_for


@pytest.mark.parametrize(
    ("share", "speed"), [(3.0, FASTEST), (1.0, FASTEST), (0.5, FASTEST / 2), (0.01, SLOWEST), (0.0, SLOWEST)]
)
def test_vehicles_live_as_fast_as_programs_get_done_what_they_compute(share: float, speed: float) -> None:
    assert speed_for(share * ROUNDS_PER_S) == speed


def test_what_is_measured_here_is_a_speed() -> None:
    assert SLOWEST <= kept_speed() <= FASTEST
