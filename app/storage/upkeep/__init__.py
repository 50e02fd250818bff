"""The database as a whole: made ready, migrated, copied, put back, and rid of what is old.

Others use ``prepare`` before they open it.
"""
