"""What is kept of every client: tokens, sessions, rates, quotas, what he commanded.

``processes`` speaks to other processes of the service in a client's name.
"""
