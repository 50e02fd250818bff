"""What a running mission sees of its vehicles and its clock: who follows, what is heard, how long it has run."""
