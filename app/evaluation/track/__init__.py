"""The dynamic case (MED13, NGCUV12): moving targets and fading localization; runs, report and pictures."""
