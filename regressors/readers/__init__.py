"""Descriptions of robots read from files: the house's YAML, URDF, and the built-in ones by name."""
