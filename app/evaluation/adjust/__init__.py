"""``bathyfleet evaluate adjust``: surveys by vehicles whose positions drift, before and after their adjustment."""
