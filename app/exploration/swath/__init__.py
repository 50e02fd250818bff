"""Full coverage with swath sonars: lines as far apart as the measured depth lets them be.

``raster`` turns the area so that lines run along its first axis, ``lines`` finds where the next one may lie,
``lines_ahead`` foretells all that are left, ``survey`` shares them out among vehicles, ``planner`` is for missions.
"""
