"""Local kriging: neighbours, merged soundings, correlation, its scales and their likelihood.

All interpolation here is made with it; others use ``kernels`` and ``levels``.
"""
