"""ACCESS13's experiment, ``bathyfleet evaluate rescue``: search of a partly known site within a time window."""
