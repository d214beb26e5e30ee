"""Simulation of a robot under a tracking controller, with the logs of its sensors."""
