"""``bathyfleet evaluate coverage``: full coverage with a swath sonar, beside what others do."""
