"""Swath sonars: pings, where their beams met the bottom, what was ensonified and what was missed.

``pings`` holds what sonars reported, ``sonar`` what a sonar can see and how well, ``density`` counts soundings in the
cells, ``holidays`` finds what was missed. All is numpy in and out.
"""
