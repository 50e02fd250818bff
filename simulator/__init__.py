"""What plays the world: sea floors, vehicles, sensors, networks and fake DUNE nodes."""
