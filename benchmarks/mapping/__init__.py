"""Maps: how true, how fast, and what is claimed of them."""
