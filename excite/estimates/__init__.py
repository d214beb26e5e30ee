"""Predictions of the memory and time that work takes, made before it starts; each rule is beside its work."""
