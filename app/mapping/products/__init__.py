"""The files that leave with a map. Every function returns the bytes of one file."""
