"""Formats of identified models."""
