"""How the Python client is made: its classes and methods are written from the service's own OpenAPI document.

``python -m app.client`` writes ``models.py`` and ``operations.py`` of :mod:`bathyfleet.client` anew. What is written by
hand there (connections, patience, streams, maps) lies beside them in ``src``.
"""
