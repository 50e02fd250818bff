"""Heavy work, wherever it is done: maps of many soundings, forecasts, adjusted tracks, files and reports.

``Compute`` is the door. What comes through it are functions of modules with inputs that can be pickled; where a Dask
cluster is named and there, its workers do it, otherwise this machine does. A worker or a cluster that is gone costs a
repetition here. Decisions never come through it.
"""
