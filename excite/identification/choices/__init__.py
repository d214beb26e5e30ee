"""Choices made for the user by predicting torques that were left out."""
