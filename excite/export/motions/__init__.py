"""Formats of motions, one file each."""
