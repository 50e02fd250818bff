"""What leads vehicles.

In come the mission in memory and the hub; out go committed decisions and orders. Others use ``step_loop.Runner``, and
``decision.decide`` for flights that are only foretold.
"""
