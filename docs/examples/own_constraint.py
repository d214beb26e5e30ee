"""A constraint of one's own: two joints that must not drift apart, ``|q_i - q_j| <= D``, since a hose joins them.

From the command line: ``excite design irp6 --constraint own_constraint:ShortHose --out designs/hose`` in this folder.
"""

import numpy as np

import excite


class Difference(excite.Limit):
    """Largest difference of two joints' positions.

    Parameters
    ----------
    first, second : str
        Names of the joints.
    largest : float
        D [rad or m].
    """

    def __init__(self, first, second, largest):
        self.names, self.largest = (first, second), largest

    def imposed(self, robot, motion):
        """Constraints of the moving coordinates."""
        i, j = (robot.joint_index(name) for name in self.names)
        bound = np.array([self.largest])
        label = (f"joint {self.names[0]} less joint {self.names[1]}",)
        difference = excite.NonlinearConstraint(
            robot.n, lambda q, dq, ddq: q[i] - q[j], -bound, bound, bound, label, ("rad",)
        )
        return (difference.restricted(motion),)


class ShortHose(Difference):
    """A hose from the arm to the forearm."""

    def __init__(self):
        super().__init__("q2", "q3", 0.6)


if __name__ == "__main__":
    design = excite.design_trajectory("irp6", constraints=[ShortHose()], search=excite.Search(starts=1))
    for use in design.limits:
        if "less" in use.label:
            print(f"{use.label}: {use.extreme:.4g} of {use.bound:.4g} {use.unit}")
