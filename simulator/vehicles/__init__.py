"""Simulated vehicles: how they move, where they believe to be, how long their battery lasts."""
