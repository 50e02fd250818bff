"""Code that numba compiles: kept from one start to the next, compiled beside a start, and never of an earlier version.

``cache`` is what programs begin with; packages that have compiled functions import ``index`` before them.
"""
