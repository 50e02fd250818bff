"""What is answered about what was measured: soundings, pings, imports, corrections, agreement, uncertainty."""
