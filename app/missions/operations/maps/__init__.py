"""A mission's map as it is asked for: whole, as pictures and features, along a line."""
