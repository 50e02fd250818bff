"""Vehicles as missions see them.

Others use ``interface`` (the protocol ``FleetLink``, states, orders, reports) and ``hub`` (all links together). Each
link in ``links`` implements the protocol.
"""
