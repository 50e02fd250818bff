"""What is decided: the newest map, the planner's proposal, clearance, separation. Nothing here is written or sent.

Others use ``decision.decide``.
"""
