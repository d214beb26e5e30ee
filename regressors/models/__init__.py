"""Regressor models: one interface, one file per model, and the base parameters of each."""
