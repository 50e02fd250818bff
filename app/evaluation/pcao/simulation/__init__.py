"""PCAO18's experiment: its world, the compiled team, what a controller is scored by, yardsticks that really try."""
