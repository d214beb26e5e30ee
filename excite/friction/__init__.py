"""Friction curves of a robot's drives, fitted to the logs of runs at constant speed and of break-away tests."""
