"""Friction of drives as curves over speed, load and temperature, with their uncertainty."""
