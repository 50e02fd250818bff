"""How vehicles are led: by references, by plans of legs, over the acoustic modem; and which commands are allowed."""
