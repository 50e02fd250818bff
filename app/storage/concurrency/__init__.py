"""Work that many wait for at the same time, and work that is done to its end."""
