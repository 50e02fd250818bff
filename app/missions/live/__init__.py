"""A mission in memory: its flight's status, journal, soundings, map, vehicles, waypoints and feed of those who watch.

Others use ``mission.LiveMission``, which owns all of it, and ``load``, which makes one from the database.
"""
