"""Names that options, task files and result files use; kept apart so that the command line starts at once."""

from __future__ import annotations

MODELS = ("differential",)
TRAJECTORIES = ("fourier",)
CRITERIA = ("condition",)
CONVENTIONS = ("gautier", "pivoted", "orthonormal")
SOLVERS = ("sqp", "ipopt")
EXECUTORS = ("process", "serial")
