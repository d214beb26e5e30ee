"""Names that options, task files and result files use; kept apart so that the command line starts at once."""

from __future__ import annotations

MODELS = ("differential", "energy", "load", "load-integral")
WINDOWED = ("energy", "load-integral")
WINDOWS = ("short", "long")
STARTS = ("random", "cosine", "quintic", "sines")
TRAJECTORIES = ("fourier", "fourier-quintic", "cosine", "bspline", "waypoints", "sines")
CRITERIA = ("condition", "frobenius", "sigma-min", "logdet", "trace")
CONVENTIONS = ("gautier", "pivoted", "orthonormal")
SCALES = ("unit", "prior", "value")
SOLVERS = ("sqp", "ipopt")
SIGNALS = ("butterworth", "differences", "fourier", "savitzky-golay", "spline")
DROPPABLE = ("truncated", "nan", "repeated")
ESTIMATORS = (
    "huber",
    "instrumental",
    "least-squares",
    "physical",
    "recursive",
    "total",
    "weighted",
)
REPEATABLE = ("instrumental", "least-squares", "weighted")
COVARIANCES = ("auto", "white", "robust")
EXECUTORS = ("process", "serial")
