"""Where a map lies on the Earth: frames (a mission's own, UTM), windows and tiles of GIS, outlines of cells.

Others use ``georeference.LocalFrame``.
"""
