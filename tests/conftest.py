"""Settings of the tests: property tests draw the same examples every time and are not timed."""

from __future__ import annotations

from hypothesis import settings

# `pytest --hypothesis-profile=default --hypothesis-seed=N` looks elsewhere.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
