"""Robot descriptions, and regressor models that are linear in the dynamic parameters."""

from regressors.neighbours import DISTRIBUTION, check_neighbours

__all__ = ["DISTRIBUTION"]  # by which `excite` and `constraints` know this package from others of its name

check_neighbours()
