"""Measured motion: what a log holds, how it is read, checked, cut and written."""
