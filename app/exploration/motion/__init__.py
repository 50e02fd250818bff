"""How vehicles move: turning circles, line ends, and when who is where. Pure: numpy in, numpy out."""
