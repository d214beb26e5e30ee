"""Limits on a robot's motion: constraints, their exact extrema over time, and diagnosis of infeasibility."""
