"""The sections of a report, by what they are about.

Every number is looked up in an answer of REST, by its place there.
"""
