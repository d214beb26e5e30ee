"""Limits on a robot's motion: constraints, their exact extrema over time, and diagnosis of infeasibility."""

try:
    from regressors import DISTRIBUTION
except Exception as error:  # whatever another package of that name raises
    if getattr(error, "name", "") == "excite-trajectories":
        raise
    raise ImportError(
        "The package `regressors` that Python finds is not that of `excite-trajectories`, which `constraints` needs. "
        "`import excite` says what is in its place, and how to remove it.",
        name="excite-trajectories",
    ) from error

__all__ = ["DISTRIBUTION"]  # by which `excite` knows this package from others of its name
