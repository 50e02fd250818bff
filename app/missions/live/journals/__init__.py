"""What a mission writes down as it goes, gathered for a moment and committed in one transaction.

Others use ``journal.Journal``.
"""
