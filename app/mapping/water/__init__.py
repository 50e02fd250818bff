"""What lies between sonar, bottom and chart: speed of sound, tides, and what depths are counted from."""
