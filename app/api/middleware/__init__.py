"""What lies round all routes: who may hold a connection, and what every request leaves behind.

``forwarding`` sends on what another process has to answer, ``direct`` is the short way to a route's function.
"""
