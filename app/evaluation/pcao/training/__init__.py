"""How controllers are trained: optimisers, where their scores are computed, curves."""
