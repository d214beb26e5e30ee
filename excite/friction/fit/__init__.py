"""Friction curves fitted to the logs of such runs."""
