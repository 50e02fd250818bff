"""The page in a browser and the service behind it."""
