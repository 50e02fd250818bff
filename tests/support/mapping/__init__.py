"""Files and tracks of soundings that tests make, and what other programs say of them."""
