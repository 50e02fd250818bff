"""Files from elsewhere: sent, read by a process that is locked in, written down."""
