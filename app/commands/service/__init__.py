"""Commands about the service itself: that it runs, its database and audit log, who may use it, what it hears."""
