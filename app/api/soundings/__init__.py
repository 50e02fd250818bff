"""Routes of what was measured: measurements, soundings, pings, files from elsewhere, corrections."""
