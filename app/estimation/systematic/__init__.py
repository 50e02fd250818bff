"""Systematic errors of a survey, estimated from what it sounded twice: depth offsets, water level, roll, sound speed.

:func:`level_errors` takes the crossings of lines; :class:`SwathTilt` takes the beams of swath sonars beside what others
sounded straight below them.
"""

from app.estimation.systematic.jackknife import Estimate
from app.estimation.systematic.levels import CrossingDepths, LevelErrors, level_errors
from app.estimation.systematic.mounting import SwathTilt, TiltErrors

__all__ = ["CrossingDepths", "Estimate", "LevelErrors", "SwathTilt", "TiltErrors", "level_errors"]
