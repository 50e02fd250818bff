"""Systems on the network: one ``Node`` per vehicle or console, the registry of all, and the admission of packets."""
