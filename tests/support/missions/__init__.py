"""Missions and what is measured in them."""
