"""The browser front end and the code that serves it."""
