"""From accepted soundings to a mission's map, and from the map to tiles, figures and files.

Others use ``builder.MapBuilder`` to make maps and ``snapshot.MapSnapshot``, a map as it leaves the service.
"""
