"""Sweep files: designs for every combination of options, resumed where they stopped, in one table."""
