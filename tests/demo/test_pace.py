"""A demonstration runs as fast as the machine decides."""

import pytest

from app.demo.pace import FASTEST, ROUNDS_PER_S, SLOWEST, kept_speed, speed_for


@pytest.mark.parametrize(
    ("times", "speed"), [(30.0, FASTEST), (5.0, FASTEST), (2.5, 2.5), (1.0, SLOWEST), (0.1, SLOWEST), (0.0, SLOWEST)]
)
def test_vehicles_live_as_fast_as_programs_get_done_what_they_compute(times: float, speed: float) -> None:
    assert speed_for(times * ROUNDS_PER_S) == speed


def test_what_is_measured_here_is_a_speed() -> None:
    assert SLOWEST <= kept_speed() <= FASTEST
