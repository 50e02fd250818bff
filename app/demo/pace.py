"""How fast a demonstration's vehicles may live: no faster than this machine decides for them, busy as it is.

A service that decides late makes vehicles circle, and plan by old maps: at sea, where nothing runs faster than the
clock, the same machine would not.
"""

import subprocess
import sys

FASTEST, SLOWEST = 5.0, 1.0
"""How much faster than real time at most, and at least."""

PROGRAMS = 2
"""The service and the vehicles: so many programs compute at the same time."""
MEASURED_S = 0.6

ROUNDS_PER_S = 0.4e6
"""What each of them has to get done for each time that vehicles live faster than the clock."""

_COUNT = f"""
import time
end, done = time.perf_counter() + {MEASURED_S}, 0
while time.perf_counter() < end:
    total = 0
    for number in range(1000):
        total += number * number
    done += 1000
print(done)
"""


def kept_speed() -> float:
    """Return how much faster than real time vehicles may live, by how much programs get done here now."""
    command = [sys.executable, "-S", "-E", "-c", _COUNT]
    counting = [
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True)  # noqa: S603
        for _ in range(PROGRAMS)
    ]
    done = sum(int(program.communicate()[0]) for program in counting)
    return speed_for(done / (PROGRAMS * MEASURED_S))


def speed_for(rounds_per_s: float) -> float:
    """Return the speed that a machine keeps up with on which a program gets so much done."""
    return min(max(round(rounds_per_s / ROUNDS_PER_S, 1), SLOWEST), FASTEST)
