"""How messages of a DUNE node travel: to whom, at which rates, by radio or TCP, and how it hears of others."""
