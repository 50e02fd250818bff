"""The papers' field experiment on any terrain: a planner beside the usual practice, even coverage and an oracle."""
