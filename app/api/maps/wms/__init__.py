"""Web Map Service (WMS 1.1.1 and 1.3.0): maps for programs that fetch one picture a view. ``routes`` has the router."""
