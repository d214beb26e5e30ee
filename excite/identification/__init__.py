"""Identification: observations ``y = W beta + e`` from logs, and estimators of beta."""
