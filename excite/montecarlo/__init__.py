"""Thousands of noisy repetitions of an experiment in one batch."""
