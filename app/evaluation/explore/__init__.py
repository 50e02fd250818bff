"""The papers' landmark experiment (AURO15), over many seeds: world, runs, yardsticks, report and pictures."""
