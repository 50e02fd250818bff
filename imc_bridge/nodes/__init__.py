"""Who is out there: one ``Node`` per vehicle or console, the roster of all, and whose packets count."""
