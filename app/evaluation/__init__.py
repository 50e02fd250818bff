"""Closed-loop runs without a network: comparisons of planners and maps."""
