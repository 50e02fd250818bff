"""The implementations of the fleet interface: IMC, REST vehicles that poll, simulation in process, Neptus sessions."""
