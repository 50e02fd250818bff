"""Neptus' panel and the service that it speaks to."""
