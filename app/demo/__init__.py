"""``bathyfleet demo``: a survey or a search with simulated vehicles, played as an operator would, over REST."""
