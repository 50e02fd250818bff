"""Legs from decision to arrival: who needs them, who gets which, what keeps them apart, committed, sent, exchanged.

Also who has energy for them, who is late, and which are taken back where a mission's length changes.
"""
