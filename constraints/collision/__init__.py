"""Distances between a robot's links and from what stands around it, as limits."""
