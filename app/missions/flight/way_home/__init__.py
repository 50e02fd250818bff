"""Vehicles that survey no more: what makes them go home, how they are led there, and what they keep on board for it."""
