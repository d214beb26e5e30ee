"""Formats of motions, one file for each maker of controllers."""
