"""Verification of a result: its predictions against a log that was not used to identify."""
