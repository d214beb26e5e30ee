"""Friction characteristics of a robot's drives: the runs that measure them, and the curves fitted to the logs."""
