"""Friction in torque limits: bounds that hold for any direction of friction."""
