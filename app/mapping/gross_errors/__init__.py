"""Gross errors among soundings: fish, multiple echoes. Others use ``outliers``."""
