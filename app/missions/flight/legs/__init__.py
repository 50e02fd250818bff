"""Legs from decision to arrival: committed, sent, exchanged for better ones; who has range for them, who is late."""
