"""A mission in memory: its journal, sounding store, vehicles, waypoints and the feed of those who watch.

Others use ``mission.LiveMission``, which owns all of it, and ``load``, which makes one from the database.
"""
