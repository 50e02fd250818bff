"""Closed-loop runs without a network: planners against each other, as in the papers and beyond them.

``runs`` is what all have in common (jobs, clusters, results, summaries); each other folder is one experiment with its
world, its runs, its report and its command.
"""
