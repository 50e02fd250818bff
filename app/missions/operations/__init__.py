"""What is done with a mission beside flying it: measurements, imports, corrections, review, history. One use a file."""
