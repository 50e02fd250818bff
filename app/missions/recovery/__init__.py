"""How every vehicle comes home: what energy it has left, the way it goes, and the table of failsafes."""
