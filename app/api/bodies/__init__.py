"""Bodies of requests: who may send one, how long it may be, and how JSON in it becomes values.

Others use ``json_route.JsonRoute`` for routes that take JSON.
"""
