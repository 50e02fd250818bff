"""Ports for tests that no other test process on this machine is given at the same time."""

import itertools
import os
import socket
from contextlib import ExitStack
from functools import cache

FIRST, REGION, REGIONS = 20_000, 500, 24
"""Below the ports that systems hand out by themselves, which any socket of any program may get."""
GAP = 16
"""Left free behind what is handed out: a vehicle takes one of the next five when its own is taken."""
HOST = "127.0.0.1"


def free_ports(count: int) -> list[int]:
    """Ports in a row, of UDP and TCP, that nothing uses now and no other test will be given soon."""
    first, turn = _region()
    while True:
        begin = next(turn)
        ports = [first + (begin + k) % (REGION - 1) for k in range(count)]
        for _ in range(count + GAP - 1):
            next(turn)
        if ports[-1] - ports[0] == count - 1 and all(map(_free, ports)):
            return ports


@cache
def _region() -> tuple[int, "itertools.cycle[int]"]:
    """Take a part of the ports for this process, which holds the first of them, by TCP, until it ends."""
    for number in itertools.islice(itertools.cycle(range(REGIONS)), os.getpid() % REGIONS, None):
        keeper = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            keeper.bind((HOST, FIRST + number * REGION))
        except OSError:
            keeper.close()
            continue
        _KEEPERS.enter_context(keeper)
        return FIRST + number * REGION + 1, itertools.cycle(range(REGION - 1))
    raise AssertionError


_KEEPERS = ExitStack()


def _free(port: int) -> bool:
    for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM):
        with socket.socket(socket.AF_INET, kind) as sock:
            try:
                sock.bind((HOST, port))
            except OSError:
                return False
    return True
