"""How well a survey agrees with itself: its lines, where they cross, and what their depths differ there.

``tracks`` holds soundings along the vehicles' ways and cuts them into lines, ``crossovers`` finds where lines cross,
``beams`` holds crosslines' beams against the grid of the main lines, ``agreement`` sums differences up. All is numpy in
and out.
"""
