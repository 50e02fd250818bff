"""Measurements of the whole program: ``python -m benchmarks.GROUP.NAME --help`` in the project's folder."""
