"""Many runs: jobs in processes or on a cluster, results kept as they come, means with their spread."""
