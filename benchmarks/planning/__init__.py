"""Planners: their time, and what surveys of theirs are worth."""
