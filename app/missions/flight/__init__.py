"""What leads vehicles.

In come the mission in memory and the hub; out go committed decisions and orders. ``runner`` takes a mission up and
flies it: ``own_legs`` where vehicles fly on their own time, ``team_steps`` where they have to stay together. Both
decide with ``deciding``, write down with ``commit`` and send with ``dispatch``. Others use ``runner.Runner``, and
``decision.decide`` for flights that are only foretold.
"""
