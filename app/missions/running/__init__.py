"""Missions that run in this process: who has which mission and vehicle, what is taken up, begun, ended, handed over.

Others use ``supervisor``, ``registry`` and ``team_changes``.
"""
