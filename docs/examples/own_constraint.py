"""A constraint of one's own: the power that each joint takes from its drive, ``|tau dq| <= P``.

From the command line: ``excite design irp6 --constraint own_constraint:HundredWatts --out designs/power`` in this
folder.
"""

import casadi as ca
import numpy as np

import excite
from regressors.models.nominal import standard_values


class PowerLimit(excite.Limit):
    """Mechanical power of every joint, with nominal parameters and without friction.

    Parameters
    ----------
    power : float
        [W]
    """

    def __init__(self, power):
        self.power = power

    def imposed(self, robot, motion):
        """Constraints of the moving coordinates."""
        model = excite.DifferentialModel(robot, excite.Terms(coulomb=False, viscous=False))
        definition, names = model.definition()
        known = standard_values(robot)
        parameters = ca.DM(definition @ np.array([known.get(name, 0.0) for name in names]))

        def power(q, dq, ddq):
            return ca.mtimes(model.rows(q, dq, ddq), parameters) * dq

        bound = np.full(robot.n, self.power)
        labels = tuple(f"joint {name} power" for name in robot.joint_names)
        units = ("W",) * robot.n
        return (excite.NonlinearConstraint(robot.n, power, -bound, bound, bound, labels, units).restricted(motion),)


class HundredWatts(PowerLimit):
    """100 W per joint."""

    def __init__(self):
        super().__init__(100.0)


if __name__ == "__main__":
    design = excite.design_trajectory("irp6", constraints=[PowerLimit(100.0)], search=excite.Search(starts=1))
    for use in design.limits:
        if use.unit == "W":
            print(f"{use.label}: {use.extreme:.4g} of {use.bound:.4g} W")
