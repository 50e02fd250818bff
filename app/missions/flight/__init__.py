"""What leads vehicles.

In come the mission in memory and the hub; out go committed decisions and orders. ``runner`` takes a mission up and
flies it: ``own_legs`` where vehicles fly on their own time, until ``survey_end`` says that all is surveyed,
``team_steps`` where they have to stay together. Both decide as ``decisions`` says, write down and send ``legs``, and
look out as ``observation`` and ``way_home`` say. Others use ``runner.Runner``, and ``decisions.decision.decide`` for
flights that are only foretold.
"""
