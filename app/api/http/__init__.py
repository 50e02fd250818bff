"""What answers and requests are made of, whatever they are about. Knows no mission and no client.

Others use ``problems``: what was wrong with which field, and what would be right.
"""
