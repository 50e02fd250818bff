"""Vehicles, fleets and panels on the IMC side."""
