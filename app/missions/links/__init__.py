"""The three implementations of the fleet interface: IMC, REST vehicles that poll, in-process simulation."""
