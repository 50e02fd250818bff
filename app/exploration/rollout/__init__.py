"""Whole-mission rollouts: team plans flown over the current estimate of everything that is still to be done."""
