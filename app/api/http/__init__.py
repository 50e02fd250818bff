"""What answers and requests are made of, whatever they are about. Knows no mission and no client.

Others use ``problems``: the documents that say what was wrong. ``error_handlers`` says which error becomes which.
"""
