"""The maneuvers of a DUNE node."""
