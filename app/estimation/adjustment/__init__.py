"""Tracks adjusted to each other: ties between overlapping soundings, fixes at the surface, and how positions drift.

:func:`adjusted` takes soundings and fixes, and returns by how much each vehicle's positions were off. The rest is how.
"""

from app.estimation.adjustment.adjustment import AdjustedTracks, adjusted, warm_up
from app.estimation.adjustment.drift import DriftModel
from app.estimation.adjustment.tracks import Fixes, TrackSoundings, thinned

__all__ = ["AdjustedTracks", "DriftModel", "Fixes", "TrackSoundings", "adjusted", "thinned", "warm_up"]
