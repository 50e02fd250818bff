"""Databases for tests, and rows to fill them with."""
