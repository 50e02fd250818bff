"""A mission's soundings after they came: corrected, adjusted, reviewed, held against each other."""
