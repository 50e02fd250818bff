"""Who asks, and whether he may: what routes name as a dependency, signing in, and shares of users.

Others use ``auth``; what is kept of a client is in ``accounts``.
"""
