"""Where a map lies on the Earth: the mission's own frame, UTM, windows and tiles of GIS, outlines of cells.

Others use ``georeference.LocalFrame``.
"""
