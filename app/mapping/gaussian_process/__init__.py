"""The default map: a nonstationary Gaussian process, what it learns, and how far it may be believed.

Others use ``gp.GaussianProcessMap``, ``fusion`` with what was known before, and ``surveys`` for maps of many soundings.
"""
