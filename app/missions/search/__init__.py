"""Missions of kind ``search``: the site, what scans tell of it, and how the flight serves it."""
