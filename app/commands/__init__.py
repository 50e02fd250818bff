"""The commands of ``bathyfleet``; ``app.cli`` puts them together. Those about the service itself are in ``service``."""
