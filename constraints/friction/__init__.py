"""Friction as torque limits count it: bounds that hold whatever its direction."""
