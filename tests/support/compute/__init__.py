"""Where heavy work of tests is done: clusters, and compiled functions that all processes share."""
