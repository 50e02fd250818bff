"""Missions as the service flies them."""
