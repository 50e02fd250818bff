"""The dynamic case over many seeds: MED13's and NGCUV12's experiments, runs, report and pictures."""
