"""What is answered, as pure data: REST, live views and the dashboard share these shapes. Nothing is computed here."""
