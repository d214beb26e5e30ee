"""Robot descriptions, and regressor models that are linear in the dynamic parameters."""

DISTRIBUTION = "excite-trajectories"

__all__ = ["DISTRIBUTION"]  # by which `excite` and `constraints` know this package from others of its name
