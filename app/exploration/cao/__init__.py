"""Cognitive Adaptive Optimization (AURO15): estimator, regressors, planner; and SPSA and FDSA, its baselines."""
