"""The papers' tables and figures, and what goes beyond them, over many seeds: runs, report and pictures."""
