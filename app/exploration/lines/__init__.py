"""Parallel lines: the lattice they lie on, the usual practice (lawnmower), teams in formation, handing over."""
