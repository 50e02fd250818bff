"""Values that Bathymetric Attributed Grids have in place of what is not there, as the format prescribes them."""

NODATA = 1_000_000.0
"""A cell's depth or uncertainty that is not known."""

NOT_REFINED = 0xFFFFFFFF
"""The index of a coarse cell, in a grid of variable resolution, that has no finer ones."""
