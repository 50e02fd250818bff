"""Heavy work, wherever it is done: maps of many soundings, forecasts, adjusted tracks, files and reports.

``Compute`` is what others use. It is given functions of modules with inputs that can be pickled; where a Dask cluster
is named and there, its workers do them, otherwise this machine does. A worker or a cluster that is gone costs a
repetition here. Decisions are never given to it.
"""
