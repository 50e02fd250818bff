"""Which processes share the database, which of them live, and which has which mission."""
