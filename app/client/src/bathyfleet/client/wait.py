"""Waiting for a mission's state: what is asked, how often, and for how long. Knows no sleeping, as ``retry``."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection
from typing import get_args

from bathyfleet.client.call import Call, part
from bathyfleet.client.models import MissionState, MissionView
from bathyfleet.client.problems import EndedError
from bathyfleet.client.streams import ENDED

STATES: tuple[str, ...] = get_args(get_args(MissionState)[0])


class Wait:
    """A wait for a mission to be in one of some states; where none is named, for its end.

    Parameters
    ----------
    mission_id : str
        The mission.
    states : collection of MissionState
        The states that end the wait.
    timeout_s : float or None
        The longest wait, from now on.
    every_s : float
        How often is asked.
    now : callable
        A clock in seconds.

    Raises
    ------
    ValueError
        For a word that is no state.
    """

    def __init__(
        self,
        mission_id: str,
        states: Collection[MissionState],
        timeout_s: float | None,
        every_s: float,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        for state in states:
            if state not in STATES:
                raise ValueError(f"states: {state!r} is not one of {', '.join(STATES)}")
        self._mission_id = mission_id
        self._states = states
        self._timeout_s = timeout_s
        self._every_s = every_s
        self._now = now
        self._until = math.inf if timeout_s is None else now() + timeout_s

    def question(self) -> Call[MissionView]:
        """Return what is asked next, with the time that is left for the answer."""
        left_s = None if self._timeout_s is None else max(self._until - self._now(), 0.0)
        return Call[MissionView]("GET", f"/missions/{part(self._mission_id)}", MissionView, within_s=left_s)

    def after(self, mission: MissionView) -> float | None:
        """Return seconds until it is asked again; None: what was waited for is there.

        Raises
        ------
        EndedError
            When the mission has ended in a state that is none of these.
        TimeoutError
            When the time is over.
        """
        if is_reached(mission, self._states):
            return None
        left_s = self._until - self._now()
        if left_s <= 0.0:
            raise TimeoutError(f"mission {mission.id} is still {mission.state} after {self._timeout_s:g} s")
        return min(self._every_s, left_s)


def is_reached(mission: MissionView, states: Collection[MissionState]) -> bool:
    """Tell whether a mission is in one of the states, or has ended where none is named.

    Raises
    ------
    EndedError
        When it has ended in a state that is none of these.
    """
    if mission.state in (states or ENDED):
        return True
    if mission.state in ENDED:
        wanted = " or ".join(states)
        raise EndedError(
            f"mission {mission.id} is {mission.state}, not {wanted}: {mission.reason or 'no reason given'}"
        )
    return False
