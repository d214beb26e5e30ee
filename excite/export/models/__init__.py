"""Formats of identified models, one file each."""
