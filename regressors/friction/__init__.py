"""Friction of drives as curves over speed, load and temperature, with what is known of their uncertainty."""
