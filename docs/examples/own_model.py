"""A model of one's own: torsion springs in the joints, ``tau = Y theta + diag(q) k``.

From the command line: ``excite design irp6 --model own_model:SpringModel --out designs/springs`` in this folder.
"""

import casadi as ca

import excite


class SpringModel(excite.DifferentialModel):
    """Joint torques with the stiffness of a spring in every joint, which is at rest at q = 0."""

    def __init__(self, robot, terms=None, *, sign_width=0.0):
        super().__init__(robot, terms, sign_width=sign_width)
        springs = (excite.Column(f"k{j}", "Nm/rad", "stiffness", "stiffness") for j in robot.joint_names)
        self.columns = (*self.columns, *springs)

    def rows(self, q, dq, ddq):
        """Torques per parameter, shape (n, p)."""
        return ca.horzcat(super().rows(q, dq, ddq), ca.diag(q))


if __name__ == "__main__":
    model = SpringModel(excite.load_robot("irp6"))
    design = excite.design_trajectory(model, search=excite.Search(starts=1))
    print(design)
    print(", ".join(design.base.names))
