"""What a vehicle's energy is still good for: told by its battery, or by the clock, and learned on the way.

Consumption is counted in *nominal seconds*: a second at the speed that the mission asks of the vehicle counts as one, a
second at another speed v as ``HOTEL + (1 - HOTEL) (v / v_nominal)^3``, since what a propeller takes grows with the cube
of the speed through water and the rest with time alone.
"""

import math
from dataclasses import dataclass, field

HOTEL = 0.3
"""Share of a vehicle's consumption at its usual speed that has nothing to do with moving."""

ASCENT_MPS = 0.3
"""How fast vehicles come up."""

FASTEST_SHARE = 3.0
"""A speed of more than so many times the usual one is a wrong figure."""

TRUSTED_PCT = 40.0
"""A level whose stated confidence is lower is not used (DUNE's own limit)."""

PRIOR_PCT = 5.0
"""The stated endurance counts as much as this much of the battery seen used."""

PRIOR_SD = 0.2
"""Relative standard deviation of a stated endurance: one battery in five is a third worse than told."""

LEAST_USED_PCT = 2.0
"""Without a stated endurance nothing is known before this much was seen used."""

UNCERTAIN_PCT = 0.75
"""Standard deviation with which levels tell what was used: batteries' gauges are neither fine nor straight."""

CLOCK_SD = 0.05
"""Relative standard deviation of a stated endurance that no battery confirms."""

CHARGED_PCT = 3.0
"""A level that rises by more was charged."""

SAFE_SD = 2.0
"""Of what is left, so many standard deviations are not counted on."""


@dataclass(frozen=True, slots=True)
class EnergyLeft:
    """What is left: percent where that is known, and time at the usual speed with its standard deviation, seconds."""

    pct: float | None
    time_s: float
    sd_s: float

    @property
    def safe_s(self) -> float:
        """How long it lasts for sure."""
        return max(self.time_s - SAFE_SD * self.sd_s, 0.0)


@dataclass
class Energy:
    """Counts what one vehicle uses.

    Parameters
    ----------
    speed_mps
        Its usual speed, the mission's.
    endurance_s
        How long it lasts at that speed, as it was stated; None: not stated.
    used_s
        What it has used in this mission, nominal seconds.
    """

    speed_mps: float
    endurance_s: float | None = None
    used_s: float = 0.0
    _level_pct: float | None = None
    _first_pct: float = field(default=0.0, repr=False)
    _first_used_s: float = field(default=0.0, repr=False)
    _least_pct: float = field(default=math.inf, repr=False)
    """The lowest level since then,"""
    _least_used_s: float = field(default=0.0, repr=False)
    """and what had been used when it was told last."""
    _rate_pct_s: float | None = field(default=None, repr=False)
    """What was learned before it was charged, percent a nominal second."""
    _told_pct_s: float | None = field(default=None, repr=False)
    """What the vehicle itself says of that."""

    def begin(self) -> None:
        """Learn anew from here: nothing was counted until now."""
        self._learn_from(self._level_pct or 0.0)

    def _learn_from(self, level_pct: float) -> None:
        self._first_pct = self._least_pct = level_pct
        self._first_used_s = self._least_used_s = self.used_s

    def renew(self) -> None:
        """Take a vehicle that tells no level to be charged: it has its whole endurance again."""
        if self._level_pct is None:
            self.used_s = 0.0
        elif self._level_pct >= self._first_pct:
            # What it used on a cable its level does not tell.
            self._learn_from(self._level_pct)

    def pass_time(self, seconds: float, speed_mps: float | None) -> None:
        """Count time under way at a speed; None: the usual one."""
        ratio = 1.0 if speed_mps is None else min(abs(speed_mps) / self.speed_mps, FASTEST_SHARE)
        self.used_s += seconds * (HOTEL + (1 - HOTEL) * ratio**3)

    def take_level(
        self, level_pct: float | None, confidence_pct: float | None = None, lasts_s: float | None = None
    ) -> None:
        """Take what the battery tells: its level, how sure it is of that, percent, and how long it says that lasts."""
        if level_pct is None or (confidence_pct is not None and confidence_pct < TRUSTED_PCT):
            return
        if self._level_pct is None:
            self._learn_from(level_pct)
        elif level_pct > self._least_pct + CHARGED_PCT:
            # On a cable it rises a little from one report to the next. Nothing is learned of that.
            self._rate_pct_s = self._rate_of(self._first_pct - self._least_pct, self._least_used_s - self._first_used_s)
            self._learn_from(level_pct)
        elif level_pct > self._first_pct:
            self._learn_from(level_pct)
        elif level_pct <= self._least_pct:
            self._least_pct, self._least_used_s = level_pct, self.used_s
        self._level_pct = level_pct
        if lasts_s and level_pct > 0.0:
            self._told_pct_s = level_pct / lasts_s

    @property
    def level_pct(self) -> float | None:
        """The battery's level as it was told and believed last."""
        return self._level_pct

    @property
    def rate_pct_s(self) -> float | None:
        """Percent of the battery that a nominal second takes; None while nobody can know."""
        return self._rate_of(*self._seen())

    def _rate_of(self, drop_pct: float, load_s: float) -> float | None:
        """Return the consumption by what was seen used of the battery, percent, and done with it, nominal seconds."""
        prior = self._prior_pct_s
        if prior is not None:
            return (PRIOR_PCT + drop_pct) / (PRIOR_PCT / prior + load_s)
        return drop_pct / load_s if drop_pct >= LEAST_USED_PCT and load_s > 0 else None

    @property
    def _prior_pct_s(self) -> float | None:
        """What is thought of the consumption before anything was seen: as before a charge, as stated, as told."""
        if self._rate_pct_s is not None:
            return self._rate_pct_s
        return self._told_pct_s if self.endurance_s is None else 100.0 / self.endurance_s

    @property
    def left(self) -> EnergyLeft | None:
        """What is left; None where neither battery nor endurance tells."""
        rate = self.rate_pct_s
        if self._level_pct is not None and rate is not None:
            time_s = self._level_pct / rate
            drop_pct, _ = self._seen()
            prior_pct = 0.0 if self._prior_pct_s is None else PRIOR_PCT
            known_pct = max(prior_pct + drop_pct, LEAST_USED_PCT)
            return EnergyLeft(
                self._level_pct, time_s, time_s * math.hypot(UNCERTAIN_PCT, PRIOR_SD * prior_pct) / known_pct
            )
        if self.endurance_s is None:
            return None
        time_s = max(self.endurance_s - self.used_s, 0.0)
        return EnergyLeft(100.0 * time_s / self.endurance_s, time_s, CLOCK_SD * time_s)

    def _seen(self) -> tuple[float, float]:
        """Return what was seen used of the battery, percent, and what was done with it, nominal seconds."""
        if self._level_pct is None:
            return 0.0, 0.0
        return max(self._first_pct - self._level_pct, 0.0), max(self.used_s - self._first_used_s, 0.0)
