"""What is answered about maps, lines across them, and sites."""
