"""The service and its page under load, attack and faults."""
