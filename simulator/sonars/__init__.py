"""Sonars that look at the sea floor: few beams, swaths, and the compiled rays of both."""
