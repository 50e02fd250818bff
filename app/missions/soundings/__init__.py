"""What happens to a measurement before it counts: its shape, its corrections, and the gate that accepts or rejects."""
