"""Vehicles as missions see them.

Others use ``interface`` (the class ``FleetLink``, states, orders, reports) and ``hub`` (all links together). Each
link in ``links`` implements it.
"""
