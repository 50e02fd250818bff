"""PCAO18's experiments: the simulation that controllers are trained in, the training, the baselines, the report."""
