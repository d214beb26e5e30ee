"""Friction curves fitted to the logs of friction measurements."""
