"""What is decided: the newest map, who is planned for, the proposal, separation. Nothing here is written or sent.

Others use ``decision.decide``.
"""
