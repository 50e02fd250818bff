"""The checklist before a start."""
