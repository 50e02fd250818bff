"""Worlds of obstacles on square cells, car parks among them, and the scanner that measures them."""
