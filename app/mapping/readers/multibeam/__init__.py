"""Files of multibeam sonars, read a ping at a time: GSF and KMALL.

``open_multibeam`` yields pings, ``read_multibeam`` the soundings near a place. Numbers in a file are believed as far as
the file's own length bears them out.
"""
