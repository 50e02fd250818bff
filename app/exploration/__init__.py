"""Where to go: objectives, constraints and planners. Pure: numpy in, numpy out."""
