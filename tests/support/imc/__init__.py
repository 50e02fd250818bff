"""Vehicles and systems that speak IMC."""
