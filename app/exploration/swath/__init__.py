"""Full coverage with swath sonars: lines as far apart as the measured depth lets them be.

``planner`` is for missions and asks ``survey``, which gives each vehicle its lines, one leg at a time. From the bottom
up: ``raster`` turns the area so that lines run along its first axis, ``lines`` finds where the next one may lie,
``entries`` from which end it is flown, ``shares`` tells who sweeps what, ``rest_of_line`` bends a line that is flown by
what it measures, ``missed`` and ``passes`` fill what lines left out, ``lines_ahead`` foretells all that is left and by
that the direction of lines.
``assignment`` and ``sent`` hold what each vehicle is at, ``tries`` what is given up. ``flown_ahead`` flies it all over
a bottom that is known.
"""
