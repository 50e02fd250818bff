"""Queries, a file for what each is about. They take a session; whoever opened it commits."""
