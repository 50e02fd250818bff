"""What everyone who watches a mission is sent, and at what pace."""
