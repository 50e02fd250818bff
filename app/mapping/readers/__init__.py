"""Soundings and maps from elsewhere: text, rasters and NetCDF, as depths in the local frame.

Files from elsewhere are read in a process of their own (``python -m app.mapping.readers``): what makes a library crash
or fill the memory ends that process and nothing else.
"""
