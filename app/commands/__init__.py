"""Commands of ``bathyfleet`` that are more than a few lines; ``app.cli`` puts them together."""
