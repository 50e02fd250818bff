"""Systems on the network: one ``Node`` per vehicle or console, the roster of all, and the admission of packets."""
