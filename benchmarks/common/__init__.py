"""What all benchmarks have in common: options, the facts of a run, pages of results."""
