"""The bathyfleet service: a fleet of underwater vehicles maps an unknown sea floor together."""

__version__ = "0.1.0"
