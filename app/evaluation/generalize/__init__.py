"""Every task on sea floors that nobody developed on: flown beside its yardstick, the worst floors looked at."""
