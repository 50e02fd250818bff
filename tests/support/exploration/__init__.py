"""Situations for planners."""
