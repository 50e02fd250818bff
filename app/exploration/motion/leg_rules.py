"""Rules by which vehicles get legs on their own time: missions fly by them, forecasts and evaluations, too."""

AHEAD = 2
"""Legs that a vehicle has after the one it flies."""

HARDLY_BEGUN = 0.6
"""A leg is decided together with those of others where no more than this part of a longest leg is left before it."""

LEAST_WAY_M = 1.0
"""A vehicle with less way left gets no leg."""

TURN_S = 4.0
"""A vehicle whose turning circle nobody knows turns in one whose radius it flies in so many seconds."""
