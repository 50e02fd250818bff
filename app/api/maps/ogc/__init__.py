"""OGC API – Features: missions for programs that read geographic features. ``routes`` has the router."""
