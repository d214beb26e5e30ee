"""Distances between a robot's links, and between links and obstacles, as limits."""
