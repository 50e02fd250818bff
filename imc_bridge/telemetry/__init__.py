"""What vehicles measured: soundings and ranges to targets, from their messages."""
