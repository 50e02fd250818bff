"""A mission's life: state machine, step loop, safety, recovery and the links to the vehicles."""
