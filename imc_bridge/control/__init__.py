"""How vehicles are led: by references, by plans of legs, over the acoustic modem; and what they may be told."""
