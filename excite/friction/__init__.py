"""Friction characteristics of a robot's drives: the runs that show them, and the curves fitted to what was measured."""
