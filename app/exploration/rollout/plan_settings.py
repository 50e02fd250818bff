"""Numbers by which plans are made alike, whether a team moves in step or each vehicle on its own legs."""

SAMPLE, SAMPLE_GRID = 400, 20
"""How many landmarks plans are judged by at most, and cells per side of the area that they are taken from."""

BUCKETS = 3
"""Buckets of landmarks per visibility."""

HEIGHT = 0.45
"""Height above the floor that first plans fly at, in visibilities, where vehicles may come that low."""

PARTS = (1.0, 0.8, 0.5, 0.2)
"""Parts of a step to try when the whole one is not feasible."""
